"""What a real machine reaches seldom or slowly: each state from three metres, old states, an hour of messages."""

from collections.abc import Callable, Iterator
from itertools import pairwise

import pytest
from playwright.sync_api import expect

from tests.harness.browser import HEARD, PHONE, Screen, heap_bytes, heard
from tests.harness.process import until
from tests.harness.stage import Stage, job, stage

pytestmark = pytest.mark.real

STATES = ("idle", "run", "hold", "jog", "alarm", "home", "check", "door", "sleep", "tool")
APART = ("idle", "run", "hold", "tool", "alarm", "sleep", "check")
LEGIBLE_MM = 14.0
"""Height of a capital letter that is read from three metres: 16 minutes of arc (ISO 9241-3)."""
PIXEL_MM = 0.277
"""Of a monitor of 24 inches with 1920 pixels in a row."""
CAPITAL = 0.7
"""Of the size of the letters."""
BAND = """() => {
    const band = document.querySelector('[data-name=band]'), word = band.querySelector('.word');
    const ground = getComputedStyle(band.querySelector('.band-state')), box = word.getBoundingClientRect();
    return {word: word.textContent, size: parseFloat(getComputedStyle(word).fontSize), colour: ground.backgroundColor,
        picture: band.querySelector('.band-state svg').innerHTML, cut: word.scrollWidth > word.clientWidth + 1,
        outside: box.right > innerWidth};
}"""
ROUND = 250
"""Messages: so many states, a tenth of that for the job, and as many lines of the console."""
ROUNDS = 7
MOST_GROWTH_BYTES = 150
"""A message, in the later rounds. What a page kept of each would be more: a state is 600 bytes as text."""


@pytest.fixture(scope="module")
def play() -> Iterator[Stage]:
    with stage() as one:
        yield one


def test_each_state_is_read_from_three_metres_by_word_colour_and_picture(
    play: Stage, screens: Callable[..., Screen]
) -> None:
    one = screens(play.url)
    one.go()
    one.named("menu").click()
    for language in ("en", "ru", "zh"):
        one.page.locator(".menu-body select").first.select_option(language)
        expect(one.page.locator("html")).to_have_attribute("lang", language)
        seen = {}
        for status in STATES:
            play.show(status=status)
            expect(one.named("band")).to_have_attribute("data-status", status)
            band = seen[status] = one.page.evaluate(BAND)
            assert band["size"] * CAPITAL * PIXEL_MM >= LEGIBLE_MM, status
            assert not band["cut"], (language, status)
            assert not band["outside"], (language, status)
        assert len({band["word"] for band in seen.values()}) == len(STATES)
        assert len({band["picture"] for band in seen.values()}) == len(STATES)
        colours = {seen[status]["colour"] for status in APART}
        assert len(colours) == len(APART), "what calls for different things has different colours"
    play.show(status="idle")


def test_the_state_of_a_lost_machine_is_old_and_looks_so(play: Stage, screens: Callable[..., Screen]) -> None:
    one = screens(play.url, PHONE, reduced_motion="reduce")
    one.go()
    digits = one.page.locator(".axes .work").first
    expect(digits).to_have_css("text-decoration-line", "none")
    play.show(link="connecting", status="offline")
    one.status("connecting")
    expect(digits).to_have_css("text-decoration-line", "line-through")
    assert one.page.evaluate("document.getAnimations().length") == 0
    play.show(status="idle")
    expect(digits).to_have_css("text-decoration-line", "none")


def test_a_job_is_held_while_its_program_is_read(play: Stage, screens: Callable[..., Screen]) -> None:
    """A real one is read too quickly for a hand; that it is held, the tests of the daemon show."""
    one = screens(play.url)
    asked: list[str] = []
    one.page.route("**/mill/*", lambda route: asked.append(route.request.url) or route.fulfill(status=202, json={}))
    one.page.route("**/mill", lambda route: route.fallback())
    one.go()
    play.say("job", job(0, status="checking"))
    one.status("run")
    one.press("pause")
    play.say("job", job(0, status="checking", hold=True))
    one.status("hold")
    one.press("resume")
    assert [url.rpartition("/")[2] for url in asked] == ["pause", "resume"]
    play.say("job", job(0, status="cancelled"))


@pytest.mark.parametrize("place", ["mill/machine", "mill/plots", "mill/console"])
def test_an_hour_of_messages_leaves_nothing_behind(play: Stage, screens: Callable[..., Screen], place: str) -> None:
    """Accelerated; the whole hour is `make bench ARGS=page`."""
    one = screens(play.url)
    one.page.add_init_script(HEARD)
    one.go(place)
    session = one.context.new_cdp_session(one.page)
    used = []
    for _ in range(ROUNDS):
        before = play.seq
        play.run(ROUND)
        until(lambda: heard(one.page) >= play.seq, why=lambda: (heard(one.page), play.seq))
        used.append(heap_bytes(session))
    assert min(after - before for before, after in pairwise(used[1:])) / (play.seq - before) < MOST_GROWTH_BYTES, used

"""The words of $G by group: nothing is lost, nothing stands twice."""

from hypothesis import given
from hypothesis import strategies as st

from protocol.grbl.modal import groups

GRBL = ["G0", "G54", "G17", "G21", "G90", "G94", "M5", "M9", "T0", "F0", "S0"]
GRBLHAL = [
    "G1", "G59.3", "G18", "G20", "G91", "G94", "G40", "G49", "G98", "G50", "M3", "M7", "M8", "T3", "F600", "S12000",
]  # fmt: skip


def test_every_word_of_grbl_has_its_group() -> None:
    assert groups(GRBL) == {
        "motion": "G0",
        "coordinate_system": "G54",
        "plane": "G17",
        "units": "G21",
        "distance": "G90",
        "feed_mode": "G94",
        "spindle": "M5",
        "coolant": ["M9"],
        "tool": "T0",
        "feed": "F0",
        "speed": "S0",
        "other": [],
    }


def test_the_words_of_grblhal() -> None:
    found = groups(GRBLHAL)
    assert found["coolant"] == ["M7", "M8"]
    assert (found["tool_length"], found["retract"], found["scaling"]) == ("G49", "G98", "G50")
    assert found["other"] == []


@given(st.lists(st.sampled_from([*GRBL, *GRBLHAL, "G1234", "", "M0", "Q7"]), max_size=30))
def test_no_word_is_lost(words: list[str]) -> None:
    shown = [word for value in groups(words).values() for word in ([value] if isinstance(value, str) else value)]
    assert sorted(shown) == sorted(words)

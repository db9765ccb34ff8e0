"""Every row of the sheet's order of events (tests/harness/changerrows.py) end to end: jobs on whole daemons.

The changer drives its pins over HTTP, and what all pins did is what the journal tells over HTTP.
"""

import asyncio
from pathlib import Path
from typing import Any

import pytest

from tests.harness.changerbench import ENDED, ROUTER, Story, told
from tests.harness.changerrows import ROWS, Row
from tests.harness.simloop import until

WANTED = ("completed", "cancelled")
CASES = [pytest.param(row, protocol, id=f"{row.name}-{protocol}") for row in ROWS for protocol in row.protocols]


class Followed:
    """Does the steps of a row."""

    def __init__(self, story: Story) -> None:
        self.story = story
        self.job: int | None = None

    async def begin(self, row: Row) -> int:
        """The changer connects, the spindle and the table are as the row has them; the last event before it."""
        s = self.story
        await s.drive({"emc-enable-in": True})
        for level in (True, False):
            await s.drive({"emc-abort-ack": level})
        if row.table is not None:
            answer = await s.client.put(f"{ROUTER}/tools", json={"text": row.table})
            assert answer.status_code == 200
        if row.spindle:
            await s.post("tool/set", tool=row.spindle)
        events = await s.get("io/events")
        return int(events[-1]["id"])

    async def do(self, verb: str, what: Any) -> None:
        s = self.story
        match verb:
            case "job":
                # A way between the words: the M6 comes when the T is prepared, as in the bare block.
                lines = "".join(f"{word}\nG1 X{1 + at / 4}\n" for at, word in enumerate(what.split(), 1))
                job = await s.bench.job(f"G21\nG90\nG1 X1 F240\n{lines}G1 X9\nM30\n")
                self.job = job["id"]
            case "drive":
                await s.drive(what)
            case "rises" | "falls":
                await until(lambda: bool(s.pin(what)) == (verb == "rises"), within_s=30)
            case "stays":
                before = len(s.bench.executed()), [pin for pin in s.router.tools.io.pins() if pin.direction == "out"]
                await asyncio.sleep(what)
                assert before == (
                    len(s.bench.executed()),
                    [pin for pin in s.router.tools.io.pins() if pin.direction == "out"],
                ), "nothing moves"
            case "ends":
                await self.status(*ENDED)
            case "cancel":
                await s.post("stop")
            case "estop":
                await s.post("estop")
            case "reset":
                await s.post("unlock")
            case _:
                raise AssertionError(verb)

    async def status(self, *wanted: str) -> Any:
        assert self.job is not None
        return await self.story.bench.status(self.job, *wanted, within_s=60)


def notation(events: list[dict[str, Any]]) -> str:
    """The sheet's notation of what stands in the journal."""
    steps = []
    for event in events:
        if event["type"] == "io_pins":
            told = [
                pin + (f"={value}" if not isinstance(value, bool) else "^" if value else "_")
                for pin, value in event["data"]["pins"]
                if pin != "state"
            ]
            steps += [", ".join(told)] if told else []
    return " | ".join(steps)


@pytest.mark.parametrize(("row", "protocol"), CASES)
def test_row(tmp_path: Path, row: Row, protocol: str) -> None:
    async def story(s: Story) -> None:
        followed = Followed(s)
        mark = await followed.begin(row)
        for verb, what in row.steps:
            await followed.do(verb, what)
        if row.ends is not None:
            view = await followed.status(*ENDED)
            assert row.ends == (view["status"] if view["status"] in WANTED else view["error"]["code"]), view
        await asyncio.sleep(0.5)
        events = await s.get(f"io/events?after={mark}")
        assert notation(events) == row.sequence
        io = await s.io()
        assert (io["tool"], io["prepared"], io["refusal"]) == (row.tool, row.prepared, row.refusal)
        assert tuple(io["parameters"].values()) == row.parameters
        assert io["waiting_for"] == row.waits_for
        ignored = [event["data"]["pin"] for event in events if event["type"] == "tool_answer_ignored"]
        assert tuple(ignored) == row.ignored
        assert s.went_to_the_place == row.place, s.bench.executed()

    others: dict[str, Any] = {"start_in_estop": False, "ack_timeout": 30.0, **row.settings}
    told(tmp_path, story, protocol=protocol, kind="external", **others)

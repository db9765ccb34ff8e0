"""What MTConnect is told of a machine, read back as an agent reads it; and no text can end a field or a line."""

import math
import re
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.outbound.feed import Notice
from server.outbound.shdr import NORMAL, UNAVAILABLE, Condition, Device, escaped, lines

AT = "2026-03-01T09:00:00.000Z"
STATE: dict[str, Any] = {
    "status": "run",
    "link": "connected",
    "position": {"machine": {"x": 1.5, "y": -2.25, "z": 0.0}, "work": {"x": 0.5}},
    "feed": 1200.0,
    "spindle": 12000.0,
    "overrides": {"feed": 90, "rapid": 50, "spindle": 110},
    "alarm": None,
    "tool": 3,
}
JOB: dict[str, Any] = {
    "id": 7,
    "status": "running",
    "program_name": "part.nc",
    "progress": {"line": 412},
    "error": None,
}


def device(state: dict[str, Any] | None = None, job: dict[str, Any] | None = None) -> Device:
    there = Device().told(Notice("state", "router", AT, {**STATE, **(state or {})}))
    return there if job is None else there.told(Notice("job", "router", AT, {**JOB, **job}))


def fields_of(line: str) -> list[str]:
    """A line as the agent takes it apart: a field in quotes may hold bars, each behind a backslash."""
    assert line.endswith("\n")
    rest, fields = line[:-1] + "|", []
    while rest:
        found = re.match(r'"((?:[^"\\|]|\\\|)+)"\||([^|]*)\|', rest)
        assert found is not None, rest
        quoted, plain = found.groups()
        fields.append(plain if quoted is None else quoted.replace("\\|", "|"))
        rest = rest[found.end() :]
    return fields


def said(before: Device | None, after: Device, prefix: str = "", **kwargs: bool) -> list[list[str]]:
    emergency = kwargs.get("emergency", False)
    earlier = {} if before is None else before.items(emergency=False)
    return [fields_of(line) for line in lines(prefix, AT, earlier, after.items(emergency=emergency))]


def test_a_machine_at_work_item_by_item() -> None:
    values, *conditions = said(None, device(job={}))
    assert values[0] == AT
    assert dict(zip(values[1::2], values[2::2], strict=True)) == {
        "avail": "AVAILABLE",
        "estop": "ARMED",
        "mode": "AUTOMATIC",
        "execution": "ACTIVE",
        "program": "part.nc",
        "line": "412",
        "Fact": "1200",
        "Fovr": "90",
        "Frapidovr": "50",
        "Sspeed": "12000",
        "Sovr": "110",
        "tool": "3",
        "Xact": "1.5",
        "Xwork": "0.5",
        "Yact": "-2.25",
        "Ywork": UNAVAILABLE,
        "Zact": "0",
        "Zwork": UNAVAILABLE,
    }
    assert conditions == [[AT, name, "NORMAL", "", "", "", ""] for name in ("system", "motion", "comms")]


def test_the_line_as_text() -> None:
    before, after = device({"status": "idle"}), device({"feed": 600.0}, {})
    assert list(lines("", AT, before.items(emergency=False), after.items(emergency=False))) == [
        f"{AT}|mode|AUTOMATIC|execution|ACTIVE|program|part.nc|line|412|Fact|600\n"
    ]
    assert list(lines("router:", AT, {}, {"system": NORMAL, "avail": "AVAILABLE"})) == [
        f"{AT}|router:avail|AVAILABLE\n",
        f"{AT}|router:system|NORMAL||||\n",
    ]


def test_what_did_not_change_is_not_said() -> None:
    assert said(device(job={}), device(job={})) == []


@pytest.mark.parametrize(
    ("status", "job", "wanted"),
    [
        ("idle", None, ("READY", "MANUAL")),
        ("run", None, ("ACTIVE", "MANUAL_DATA_INPUT")),
        ("jog", None, ("ACTIVE", "MANUAL")),
        ("home", None, ("ACTIVE", "MANUAL")),
        ("hold", None, ("FEED_HOLD", "MANUAL")),
        ("sleep", None, ("STOPPED", "MANUAL")),
        ("alarm", None, ("STOPPED", "MANUAL")),
        ("check", None, ("READY", "MANUAL")),
        ("idle", "queued", ("READY", "MANUAL")),
        ("idle", "checking", ("READY", "MANUAL")),
        ("idle", "running", ("ACTIVE", "AUTOMATIC")),
        ("run", "running", ("ACTIVE", "AUTOMATIC")),
        ("hold", "paused", ("FEED_HOLD", "AUTOMATIC")),
        ("idle", "paused", ("INTERRUPTED", "AUTOMATIC")),
        ("door", "paused", ("INTERRUPTED", "AUTOMATIC")),
        ("idle", "waiting", ("PROGRAM_STOPPED", "AUTOMATIC")),
        ("tool", "waiting", ("PROGRAM_STOPPED", "AUTOMATIC")),
        ("alarm", "running", ("STOPPED", "AUTOMATIC")),
        ("idle", "completed", ("READY", "MANUAL")),
        ("idle", "interrupted", ("READY", "MANUAL")),
    ],
)
def test_execution_and_mode(status: str, job: str | None, wanted: tuple[str, str]) -> None:
    items = device({"status": status}, None if job is None else {"status": job}).items(emergency=False)
    assert (items["execution"], items["mode"]) == wanted


def test_a_job_that_waits_does_not_hide_the_one_that_runs() -> None:
    there = device(job={}).told(Notice("job", "router", AT, {**JOB, "id": 8, "status": "queued", "program_name": "b"}))
    assert there.items(emergency=False)["program"] == "part.nc"
    there = there.told(Notice("job", "router", AT, {**JOB, "status": "completed"}))
    assert there.items(emergency=False)["program"] == UNAVAILABLE


def test_an_alarm_is_a_fault_and_is_taken_back() -> None:
    limit, probe = {"code": 1, "axis": "x", "message": "Hard limit"}, {"code": 4, "axis": None, "message": "Probe"}
    calm = device({"status": "idle"})
    alarmed, other = device({"status": "alarm", "alarm": limit}), device({"status": "alarm", "alarm": probe})
    assert [AT, "system", "FAULT", "1", "", "", "Hard limit"] in said(calm, alarmed)
    assert said(alarmed, other) == [
        [AT, "system", "NORMAL", "", "", "", ""],
        [AT, "system", "FAULT", "4", "", "", "Probe"],
    ]
    assert said(other, calm)[-1] == [AT, "system", "NORMAL", "", "", "", ""]
    nameless = device({"status": "alarm", "alarm": {"code": None, "axis": None, "message": ""}})
    assert nameless.items(emergency=False)["system"] == Condition("FAULT", "alarm")


def test_an_emergency_stop_is_triggered() -> None:
    assert said(device(), device(), emergency=True) == [[AT, "estop", "TRIGGERED"]]


def test_a_job_that_failed_is_told_until_the_next_one_runs() -> None:
    error = {"code": "machine_error", "message": "ERROR 3", "line_from": None, "line_to": None}
    failed = device(job={"status": "failed", "error": error})
    assert failed.items(emergency=False)["motion"] == Condition("FAULT", "machine_error", "ERROR 3")
    doubt = device(job={"status": "interrupted", "error": {**error, "code": "in_doubt"}})
    assert doubt.items(emergency=False)["motion"] == Condition("FAULT", "in_doubt", "ERROR 3")
    refused = device(job={"status": "paused", "error": {**error, "code": "line_refused"}})
    assert refused.items(emergency=False)["motion"] == Condition("WARNING", "line_refused", "ERROR 3")
    again = failed.told(Notice("job", "router", AT, {**JOB, "id": 8}))
    assert again.items(emergency=False)["motion"] == NORMAL


@pytest.mark.parametrize(("link", "level"), [("connecting", "FAULT"), ("disconnected", UNAVAILABLE)])
def test_nothing_is_claimed_of_a_machine_that_is_not_there(link: str, level: str) -> None:
    items = device({"link": link, "status": "offline"}, {}).items(emergency=True)
    assert items.keys() == device().items(emergency=False).keys()
    comms, system = items.pop("comms"), items.pop("system")
    assert isinstance(comms, Condition)
    assert comms.level == level
    assert system == Condition(UNAVAILABLE)
    assert items.pop("motion") == NORMAL
    assert set(items.values()) == {UNAVAILABLE}


def test_a_job_that_is_gone_when_things_are_told_anew_is_forgotten() -> None:
    there = device(job={}).told(Notice("state", "router", AT, STATE, fresh=True))
    assert there.items(emergency=False)["program"] == UNAVAILABLE


HOSTILE = ["a|b", 'say "x"', "a\nb|FAULT", "|", '"|\\|"', "a\\", "\\|", "\r\n* PONG 1\n", "\u2028|\x00", "ж|ø", ""]


@pytest.mark.parametrize("text", HOSTILE)
def test_hostile_names_and_messages_stay_in_their_field(text: str) -> None:
    after = device({"alarm": {"code": 1, "axis": None, "message": text}}, {"program_name": text or "-"})
    found = said(None, after)
    assert len(found) == 4
    assert len(found[0]) == 1 + 2 * 18
    assert [len(fields) for fields in found[1:]] == [7, 7, 7]


@given(st.text(max_size=600))
def test_any_text_is_one_field_of_one_line(text: str) -> None:
    line = f"{AT}|program|{escaped(text)}|line|1\n"
    found = fields_of(line)
    assert len(found) == 5
    assert line.count("\n") == 1
    assert "\r" not in line
    assert len(found[2]) <= 512


def test_a_plain_text_with_bars_arrives_as_it_was() -> None:
    assert fields_of(f"{escaped('left | right')}\n") == ["left | right"]


@given(
    odd=st.dictionaries(st.sampled_from(["feed", "spindle", "tool"]), st.none() | st.text() | st.floats()),
    text=st.none() | st.text(),
)
def test_odd_values_are_unavailable(odd: dict[str, Any], text: str | None) -> None:
    there = device({**odd, "status": text, "position": {"machine": {}, "work": None}, "overrides": {}})
    values = said(None, there.told(Notice("job", "router", AT, {**JOB, "progress": None, "program_name": text})))[0]
    items = dict(zip(values[1::2], values[2::2], strict=True))
    assert items["line"] == items["Xact"] == items["Fovr"] == UNAVAILABLE
    for name, key in (("Fact", "feed"), ("Sspeed", "spindle"), ("tool", "tool")):
        if key in odd:
            assert items[name] == UNAVAILABLE or math.isfinite(float(items[name]))

"""Status reports, field by field (grbl II.5 and grblHAL's fields)."""

from typing import Any

import pytest

from protocol.grbl.reports import STATES, MalformedReportError, StatusReport, integer, parse_report

FIELDS: dict[str, dict[str, Any]] = {
    "MPos:1.000,-2.000,3.500": {"machine_position": (1.0, -2.0, 3.5)},
    "WPos:1.000,2.000,3.000,4.000": {"work_position": (1.0, 2.0, 3.0, 4.0)},
    "WCO:0.000,1.500,0.000": {"work_offset": (0.0, 1.5, 0.0)},
    "MPos:1.0000,0.0000,0.0000|F:10.0": {"machine_position": (25.4, 0.0, 0.0), "feed_mm_min": 254.0},
    "Ov:100,50,120": {"overrides": (100, 50, 120), "accessories": frozenset()},
    "Ov:100,100,100|A:SFM": {
        "overrides": (100, 100, 100),
        "accessories": frozenset({"spindle_cw", "flood", "mist"}),
    },
    "A:C": {"accessories": frozenset({"spindle_ccw"})},
    "A:TE": {"accessories": frozenset({"tool_change", "encoder"})},
    "A:": {"accessories": frozenset()},
    "A:Z": {"accessories": frozenset({"accessory_z"})},
    "Bf:15,128": {"planner_free": 15, "rx_free": 128},
    "Ln:99999": {"line": 99999},
    "F:500": {"feed_mm_min": 500.0},
    "FS:500,8000": {"feed_mm_min": 500.0, "spindle_rpm": 8000.0},
    "FS:500,8000,7990": {"feed_mm_min": 500.0, "spindle_rpm": 8000.0, "spindle_actual_rpm": 7990.0},
    "Pn:XYZPDHRS": {
        "pins": frozenset(
            {"limit_x", "limit_y", "limit_z", "probe", "safety_door", "feed_hold", "reset", "cycle_start"}
        )
    },
    "Pn:ABCUVWOLTEFMQ": {
        "pins": frozenset(
            {
                *(f"limit_{axis}" for axis in "abcuvw"),
                "probe_disconnected",
                "block_delete",
                "optional_stop",
                "emergency_stop",
                "motor_fault",
                "motor_warning",
                "single_block",
            }
        )
    },
    "Pn:9": {"pins": frozenset({"pin_9"})},
    "WCS:G54": {"work_system": "G54"},
    "Sc:": {"scaled_axes": ""},
    "Sc:XY": {"scaled_axes": "XY"},
    "MPG:1": {"mpg": True},
    "MPG:0": {"mpg": False},
    "H:0": {"homed": False},
    "H:1,7": {"homed": True},
    "D:1": {"diameter": True},
    "T:3": {"tool": 3},
    "P:0": {"probe": 0},
    "TLR:1": {"tool_reference": True},
    "AR:": {"auto_report": True},
    "AR:200": {"auto_report": True},
    "AR:0": {"auto_report": False},
    "DTG:1.000,0.000,0.000": {"distance_to_go": (1.0, 0.0, 0.0)},
    "SD:42.1,/a.nc": {"sd": "42.1,/a.nc"},
    "SD:Pending": {"sd": "Pending"},
    "In:-1": {"input_waited": -1},
    "FW:grblHAL": {"firmware": "grblHAL"},
    "SP1:12,3": {"other": (("SP1", "12,3"),)},
}


@pytest.mark.parametrize("fields", FIELDS)
def test_a_field_says(fields: str) -> None:
    assert parse_report(f"<Run|{fields}>") == StatusReport("run", **FIELDS[fields])


@pytest.mark.parametrize("name", STATES)
def test_states(name: str) -> None:
    assert parse_report(f"<{name}>").status == STATES[name]
    assert parse_report(f"<{name}:3>").substate == 3


def test_the_full_report_of_grblhal() -> None:
    report = parse_report(
        "<Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|WCO:0.000,0.000,0.000|WCS:G54|Ov:100,100,100"
        "|A:|Sc:|MPG:0|H:0|T:0|P:0|TLR:0|FW:grblHAL>"
    )
    assert (report.planner_free, report.rx_free, report.tool, report.homed, report.mpg) == (100, 1023, 0, False, False)
    assert (report.accessories, report.scaled_axes, report.firmware) == (frozenset(), "", "grblHAL")


@pytest.mark.parametrize(
    "text",
    [
        "",
        "<>",
        "<Idle",
        "Idle>",
        "<idle>",
        "<Idle:>",
        "<Idle:x>",
        "<Idle|>",
        "<Idle|MPos>",
        "<Idle|:1>",
        "<Idle|MPos:1,2,>",
        "<Idle|MPos:nan,1,1>",
        "<Idle|MPos:1e5,1,1>",
        "<Idle|MPos:" + ",".join("1" * 17) + ">",
        "<Idle|MPos:" + "1" * 20 + ">",
        "<Idle|FS:1>",
        "<Idle|FS:1,2,3,4>",
        "<Idle|FS:1,2|F:1>",
        "<Idle|MPos:0,0,0|WPos:0,0,0>",
        "<Idle|Bf:1>",
        "<Idle|Bf:-1,5>",
        "<Idle|Ov:100,100>",
        "<Idle|Ov:>",
        "<Idle|MPG:2>",
        "<Idle|H:1,x>",
        "<Idle|Pn:X!>",
        "<Idle|Pn:" + "X" * 90 + ">",
        "<Idle|T:1|T:1>",
        "<Idle|" + "|".join(f"q{n}:1" for n in range(50)) + ">",
        "<Idle|MPos:0.000,0.000,0.000|FS:0,0<Run|MPos:0.000,0.000,0.000>",
    ],
)
def test_half_a_report_is_none(text: str) -> None:
    with pytest.raises(MalformedReportError):
        parse_report(text)


def test_absent_inputs_are_inactive_ones() -> None:
    assert parse_report("<Idle>").pins == frozenset()


def test_integers_are_ascii_digits() -> None:
    with pytest.raises(MalformedReportError):
        integer("\u0661")

"""grblHAL: what differs (grbl, second part)."""

import pytest

from tests.harness.grblconsole import Console


def hal(**settings: object) -> Console:
    return Console(flavour="grblHAL", **settings)  # type: ignore[arg-type]


def test_the_banner() -> None:
    console = hal()
    console.tell(b"\x18")
    assert console.rest() == ["", "GrblHAL 1.1f ['$' or '$HELP' for help]"]


def test_build_information() -> None:
    said = hal().tell("$I\n")
    assert said[:5] == [
        "[VER:1.1f.20260817:]",
        "[OPT:VNML+,100,1024,3,0]",
        "[AXS:3:XYZ]",
        "[NEWOPT:ENUMS,RT+,TC,SED]",
        "[FIRMWARE:grblHAL]",
    ]
    assert all(line.startswith("[") for line in said[:-1])
    assert said[-1] == "ok"
    assert hal().tell("$I+\n") == said


def test_the_full_report_has_empty_fields() -> None:
    assert hal().tell(b"\x87") == [
        "<Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|WCO:0.000,0.000,0.000|WCS:G54|Ov:100,100,100"
        "|A:|Sc:|MPG:0|H:0|T:0|P:0|TLR:0|FW:grblHAL>"
    ]


def test_other_realtime_bytes() -> None:
    console = hal()
    assert console.tell(b"\x80")[0].startswith("<Idle|")
    assert console.tell(b"\x83") == ["[GC:G0 G54 G17 G21 G90 G94 G40 G49 G98 G50 M5 M9 T0 F0 S0.]"], "and no ok"
    console.tell("G1X50F600\n")
    console.wait(0.5)
    console.tell(b"\x82")
    console.wait(1.0)
    assert console.state() == "Hold:0"
    console.tell(b"\x81")
    assert console.state() == "Run"
    console.rest()
    console.tell(b"\x19")
    assert console.rest()[-1].startswith("GrblHAL")


@pytest.mark.parametrize(
    ("mask", "report"),
    [
        (0, "<Idle|WPos:0.000,0.000,0.000>"),
        (1, "<Idle|MPos:0.000,0.000,0.000>"),
        (3 + 8, "<Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0>"),
        (1 + 16, "<Idle|MPos:0.000,0.000,0.000|Pn:X>"),
        (1 + 32, "<Idle|MPos:0.000,0.000,0.000|WCO:0.000,0.000,0.000|WCS:G54>"),
    ],
)
def test_the_mask_turns_fields_on_and_off(mask: int, report: str) -> None:
    console = hal(dollar={10: mask})
    console.machine.press("X", 0.0)
    assert console.tell("?") == [report]


def test_the_number_of_an_alarm_and_the_detail_of_a_run() -> None:
    console = hal(dollar={10: 511 + 1024 + 2048})
    console.tell("G38.2Z-5F600\n")
    assert console.state() == "Run:2"
    console.rest()
    assert console.state() == "Alarm:5"
    console.tell("$X\n")
    assert console.state() == "Idle"
    console = hal()
    console.tell("G38.2Z-5F600\n")
    console.rest()
    assert console.state() == "Alarm"
    assert console.tell(b"\x87")[0].startswith("<Alarm:5|")


def test_mpg() -> None:
    console = hal()
    assert "|MPG:1|" in console.tell(b"\x8b")[0]
    assert "|MPG:0|" in console.tell(b"\x8b")[0]
    console.machine.set_mpg(True, console.now)
    assert "|MPG:1|" in console.heard()[0]


def test_m6_is_answered_at_once_and_the_machine_waits_for_a_tool() -> None:
    console = hal()
    assert console.tell("T1M6\n") == ["ok"]
    assert console.state() == "Tool"
    assert console.tell("G1X10F600\n") == [], "the stream is held"
    console.tell(b"\xa3")
    assert console.tell("$G\n")[-1] == "ok", "the second stream is not"
    assert console.tell("$J=G91Z5F600\n") == ["ok"]
    assert console.state() == "Jog"
    console.rest()
    assert console.state() == "Tool"
    assert console.tell("G0X1\n") == ["error:40"]
    assert console.tell("~") == ["ok"], "of the line that waited"
    console.rest()
    assert console.at(10, 0, 5)
    assert "|T:1|" in console.tell(b"\x87")[0]


def test_probing_in_a_tool_change() -> None:
    console = hal(probe_z=-60.0)
    console.tell("T2M6\n")
    console.tell(b"\xa3")
    console.tell("G38.2Z-20F600\n")
    assert console.rest() == ["[PRB:0.000,0.000,-10.000:1]", "ok"]
    assert console.state() == "Tool"
    console.tell("~")
    assert console.state() == "Idle"


def test_m6_without_the_protocol_is_ignored() -> None:
    console = hal(tool_change=False)
    assert console.tell("T1M6\n") == ["ok"]
    assert console.state() == "Idle"
    assert "TC" not in console.tell("$I\n")[3]
    console = hal(dollar={341: 4})
    console.tell("T1M6\n")
    assert console.state() == "Idle"


def test_a_tool_change_waits_for_motion_and_stops_the_spindle() -> None:
    console = hal()
    console.tell("M3S500\nG1X10F600\n")
    assert console.tell("T1M6\n") == []
    console.rest()
    assert console.state() == "Tool"
    assert console.field("FS") == "0,0"


def test_a_reset_ends_a_tool_change() -> None:
    console = hal()
    console.tell("T1M6\n")
    console.tell(b"\xa3\x18")
    console.rest()
    assert console.state() == "Idle"
    assert console.tell("G21\n") == ["ok"]


@pytest.mark.parametrize(
    ("text", "first"),
    [
        ("$ES", "[SETTING:0|2|Step pulse|us|5|###0|||0|0]"),
        ("$EG", "[SETTINGGROUP:0|0|Root]"),
        ("$EA", "[ALARMCODE:1||hard limit, position lost]"),
        ("$EE", "[ERRORCODE:1||a letter is expected]"),
        ("$SED=110", "[SETTINGDESCR:110|X maximum rate.]"),
        ("$E*", "[SETTINGGROUP:0|0|Root]"),
        ("$+", "$0=10.0"),
        ("$HELP", "Help topics:"),
    ],
)
def test_enumerations(text: str, first: str) -> None:
    said = hal().tell(text + "\n")
    assert said[0] == first
    assert said[-1] == "ok"


def test_every_setting_is_enumerated() -> None:
    console = hal()
    numbers = [int(line.split(":")[1].split("|")[0]) for line in console.tell("$ES\n")[:-1]]
    assert numbers == list(console.settings())
    groups = {line.split("|")[1] for line in console.tell("$ES\n")[:-1]}
    assert groups <= {line.split(":")[1].split("|")[0] for line in console.tell("$EG\n")[:-1]}


def test_a_percent_sign_and_g59_3_are_fine() -> None:
    console = hal()
    assert console.tell("%\nG59.3\nT300\n") == ["ok", "ok", "ok"]
    assert console.tell("#1=3\n") == ["error:1"]
    assert "[G59.3:0.000,0.000,0.000]" in console.tell("$#\n")


def test_writing_settings_makes_it_not_deaf() -> None:
    assert hal().tell("$11=0.02\n") == ["ok"]


def test_1_1h_has_none_of_it() -> None:
    console = Console()
    assert console.tell(b"\x87\x80\x83\xa3") == []
    assert console.tell("$ES\n$HELP\n$I+\n") == ["error:2", "error:5", "error:3"]


def test_m61_says_which_tool_is_in() -> None:
    console = hal()
    assert console.tell("M61\nM61Q7\nG43H1\n") == ["error:28", "ok", "ok"]
    assert "|T:7|" in console.tell(b"\x87")[0]
    assert " T7 " in console.tell("$G\n")[0]

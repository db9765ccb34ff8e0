"""What a controller says, line by line as the sheet has it (grbl II.3, II.6, and grblHAL's differences)."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol.events import ProtocolFault
from protocol.grbl.codec import CONSOLE_TEXT_LIMIT, MAX_LINE_BYTES, Decoder, parse_line, printable
from protocol.grbl.messages import (
    AlarmRaised,
    AxisNames,
    Banner,
    CodeEnumerated,
    Echo,
    Fact,
    FileListed,
    FreeText,
    Heard,
    Help,
    NewOptions,
    OffsetReported,
    Ok,
    Options,
    ParserState,
    ProbeResult,
    Refusal,
    Said,
    SettingDescribed,
    SettingEnumerated,
    SettingGroup,
    SettingValue,
    StartupAnswer,
    StartupBlock,
    Version,
)
from protocol.grbl.reports import StatusReport

LINES = {
    # II.3
    "ok": Ok(),
    "error:20": Refusal(20),
    "error: Bad number format": Refusal(None, "Bad number format"),
    "ALARM:3": AlarmRaised(3),
    "ALARM: Hard limit": AlarmRaised(None, "Hard limit"),
    ">G21G54:ok": StartupAnswer("G21G54", None),
    ">G20:error:20": StartupAnswer("G20", 20),
    "Grbl 1.1h ['$' for help]": Banner("Grbl 1.1h ['$' for help]", "grbl", "1.1h"),
    "Grbl 1.1f ['$' or '$HELP' for help]": Banner("Grbl 1.1f ['$' or '$HELP' for help]", "grbl", "1.1f"),
    "GrblHAL 1.1f ['$' or '$HELP' for help]": Banner("GrblHAL 1.1f ['$' or '$HELP' for help]", "grblhal", "1.1f"),
    "[MSG:'$H'|'$X' to unlock]": Said("'$H'|'$X' to unlock"),
    "[MSG:Pgm End]": Said("Pgm End"),
    "[MSG:]": Said(""),
    "[PRB:1.000,-2.500,0.000:1]": ProbeResult((1.0, -2.5, 0.0), True),
    "[PRB:0.1000,0.0000,0.0000:0]": ProbeResult((2.54, 0.0, 0.0), False, True),
    "[echo:G1X10]": Echo("G1X10"),
    # II.6
    "[HLP:$$ $# $G $I $N $x=val]": Help("$$ $# $G $I $N $x=val"),
    "$110=500.000": SettingValue(110, "500.000"),
    "$0=10 (step pulse, usec)": SettingValue(0, "10"),
    "$70=my host)": SettingValue(70, "my host)"),
    "$N0=G21G54": StartupBlock(0, "G21G54"),
    "$N1=": StartupBlock(1, ""),
    "[GC:G0 G54 G17 G21 G90 G94 M5 M9 T0 F0 S0]": ParserState(
        ("G0", "G54", "G17", "G21", "G90", "G94", "M5", "M9", "T0", "F0", "S0")
    ),
    "[GC:G0 G98 G50 M5 M9 T0 F0 S0.]": ParserState(("G0", "G98", "G50", "M5", "M9", "T0", "F0", "S0")),
    "[G54:4.000,0.000,0.000]": OffsetReported("G54", (4.0, 0.0, 0.0)),
    "[G59.3:1.0000,0.0000,0.0000]": OffsetReported("G59.3", (25.4, 0.0, 0.0), True),
    "[G92:0.000,0.000,0.000]": OffsetReported("G92", (0.0, 0.0, 0.0)),
    "[TLO:1.500]": OffsetReported("TLO", (1.5,)),
    "[TLO:0.000,0.000,1.500]": OffsetReported("TLO", (0.0, 0.0, 1.5)),
    "[HOME:0.000,0.000,-1.000:7]": OffsetReported("HOME", (0.0, 0.0, -1.0)),
    "[VER:1.1h.20190830:my mill]": Version("1.1h", "20190830", "my mill"),
    "[VER:1.1f.20260817:]": Version("1.1f", "20260817", ""),
    "[VER:2]": Version("2", "", ""),
    "[OPT:V,15,128]": Options("V", 15, 128),
    "[OPT:VNML+,100,1024,3,0]": Options("VNML+", 100, 1024, 3, 0),
    "[OPT:]": Options(""),
    "[NEWOPT:ENUMS,RT+,TC,SED]": NewOptions(("ENUMS", "RT+", "TC", "SED")),
    "[AXS:3:XYZ]": AxisNames(("x", "y", "z")),
    "[FIRMWARE:grblHAL]": Fact("FIRMWARE", "grblHAL"),
    "[NVS STORAGE:*EEPROM]": Fact("NVS STORAGE", "*EEPROM"),
    "[SIGNALS]": Fact("SIGNALS"),
    "[T:1,0.000,0.000,0.000]": Fact("T", "1,0.000,0.000,0.000"),
    # grblHAL's enumerations and files
    "[SETTING:0|9|Step pulse time|microseconds|6|#0.0|2.0||0|0]": SettingEnumerated(
        0, 9, "Step pulse time", "microseconds", 6, "#0.0", 2.0
    ),
    "[SETTING:74|]": SettingEnumerated(74, None, "", "", None),
    "[SETTING:300|2|Host|text|7||x|64|1|1]": SettingEnumerated(300, 2, "Host", "text", 7, "", None, 64.0, True, True),
    "[SETTINGGROUP:4|0|Limits]": SettingGroup(4, 0, "Limits"),
    "[SETTINGGROUP:4]": SettingGroup(4, None, ""),
    "[SETTINGDESCR:22|Enables homing]": SettingDescribed(22, "Enables homing"),
    "[ALARMCODE:1||Hard limit has been triggered.]": CodeEnumerated("alarm", 1, "Hard limit has been triggered."),
    "[ERRORCODE:3|Invalid|]": CodeEnumerated("error", 3, "Invalid"),
    "[FILE:/a.nc|SIZE:123]": FileListed("/a.nc", 123),
    "[FILE:/sub|SIZE:-1]": FileListed("/sub", None),
    "[FILE:/b.nc|SIZE:7|UNUSABLE]": FileListed("/b.nc", 7),
    # neither
    "Help arguments:": FreeText("Help arguments:"),
    "$HELP": FreeText("$HELP"),
    ">nothing": FreeText(">nothing"),
    "[a]b]": FreeText("[a]b]"),
    "<Idle|MPos:0.000,0.000,0.000|FS:0,0>": StatusReport(
        "idle", machine_position=(0.0, 0.0, 0.0), feed_mm_min=0.0, spindle_rpm=0.0
    ),
}


@pytest.mark.parametrize("line", LINES)
def test_a_line_means(line: str) -> None:
    assert parse_line(line.encode()) == LINES[line]


@pytest.mark.parametrize(
    "line",
    [
        b"[MSG:half",
        b"[PRB:1,2,3]",
        b"[PRB:1,2,3:2]",
        b"[G54:one,two]",
        b"[AXS:3:XXZ]",
        b"[AXS:0:]",
        b"[SETTING:]",
        b"[SETTINGGROUP:x|y]",
        b"[SETTINGDESCR:|x]",
        b"[ALARMCODE:]",
        b"<Idle",
        b"o\xffk",
        b"\x00ok",
        b"[VER:\xb2\x00]",
        "[PRB:\u0661,2,3:1]".encode(),
    ],
)
def test_a_malformed_line_is_a_fault(line: bytes) -> None:
    fault = parse_line(line)
    assert isinstance(fault, ProtocolFault)
    assert fault.kind == "malformed"


def test_names_of_people_may_be_utf8() -> None:
    assert parse_line("[MSG:Файл открыт]".encode()) == Said("Файл открыт")
    assert parse_line("[FILE:/деталь.nc|SIZE:²]".encode()) == FileListed("/деталь.nc", None)


def read(*pieces: bytes) -> list[Heard]:
    decoder = Decoder()
    return [heard for piece in pieces for heard in decoder.receive_data(piece)]


def test_lines_end_with_cr_lf_and_empty_ones_are_nothing() -> None:
    assert [heard.text for heard in read(b"\r\nGrbl 1.1h ['$' for help]\r\n\r\nok\r\n")] == [
        "Grbl 1.1h ['$' for help]",
        "ok",
    ]


def test_a_line_that_never_ends_is_skipped_and_told_once() -> None:
    heard = read(b"x" * MAX_LINE_BYTES, b"x", b"y" * 5000, b"z\nok\n")
    assert [item.message for item in heard] == [
        ProtocolFault("too_long", f"over {MAX_LINE_BYTES} bytes without a line end"),
        Ok(),
    ]


def test_the_decoder_holds_no_more_than_a_line() -> None:
    decoder = Decoder()
    for _ in range(100):
        list(decoder.receive_data(b"x" * 1000))
        assert len(decoder._buffer) <= MAX_LINE_BYTES


def test_text_for_people_is_bounded_and_printable() -> None:
    text = printable(b"\x1b[2J" + b"\xff" * 5000)
    assert text.isprintable()
    assert text.isascii()
    assert len(text) <= 4 * CONSOLE_TEXT_LIMIT
    assert text.startswith("\\x1b[2J")


SAMPLE = "".join(line + "\r\n" for line in LINES).encode()


@given(st.binary(max_size=400))
def test_any_bytes_raise_nothing(data: bytes) -> None:
    for heard in read(data + b"\n"):
        assert heard.text.isprintable()


@given(st.data())
def test_damaged_lines_raise_nothing(data: st.DataObject) -> None:
    line = bytearray(data.draw(st.sampled_from(sorted(LINES))).encode())
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(line)))
        line[at : at + data.draw(st.integers(0, 3))] = data.draw(st.binary(max_size=3))
    list(Decoder().receive_data(bytes(line) + b"\n"))


@given(st.lists(st.integers(0, len(SAMPLE)), max_size=20))
def test_chunking_does_not_matter(cuts: list[int]) -> None:
    at = [0, *sorted(cuts), len(SAMPLE)]
    assert read(*(SAMPLE[a:b] for a, b in pairwise(at))) == read(SAMPLE)

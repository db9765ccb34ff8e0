"""check and translate for a controller of NC frames."""

import json
from pathlib import Path

import pytest

from tests.server.cli.conftest import Run

EXAMPLE = b"G00,G90,G42,X35000,Z160000,F50,S07,T33,M03,LF\n"
TOLD = ("--resolution", "1", "--tool-radius", "5000", "--compensation", "offset")
PROGRAM = b"G21,G90,T1,M3,S5\nG0 X10 Z2; G1 Z-5 F100\nM0\nG3 X10 Z-5 I-5\nM30\n"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "part.nc"
    path.write_bytes(PROGRAM)
    return path


def test_the_example_of_the_source_to_the_byte(millstream: Run, file: Path) -> None:
    file.write_bytes(EXAMPLE)
    outcome = millstream("translate", file, "--profile", "ncframe-lathe", "--hex", *TOLD)
    assert (outcome.code, outcome.out) == (0, "F7 00 03 00 9C 40 02 84 88 32 07 21\n")
    outcome = millstream("translate", file, "--profile", "ncframe-lathe", *TOLD)
    assert outcome.out == "G0 M3 X40000 Z165000 F50 S7 T33\n"


def test_a_frame_a_line(millstream: Run, file: Path) -> None:
    assert millstream("translate", file, "-p", "ncframe-lathe").out.splitlines() == [
        "M3 S5 T1",
        "G0 X10000 Z2000",
        "G1 Z-7000 F100",
        "M0",
        "G3 X-10000 R5000 F100 S5",
        "X10000 R5000",
        "M30",
    ]


def test_as_json_each_frame_has_its_line_its_bytes_and_its_time(millstream: Run, file: Path) -> None:
    found = [
        json.loads(line) for line in millstream("translate", file, "-p", "ncframe-lathe", "--json").out.splitlines()
    ]
    assert found[2] == {
        "line": 2,
        "frame": "G1 Z-7000 F100",
        "hex": "94 01 FF E4 A8 64",
        "seconds": pytest.approx(4.2, abs=0.1),
        "barrier": False,
    }
    assert [one["line"] for one in found if one["barrier"]] == [3, 5]


def test_the_bytes_are_those_that_go_out(millstream: Run, file: Path) -> None:
    # F and T alone would have the head 05, which is ENQ.
    file.write_bytes(b"F50 T3\n")
    assert millstream("translate", file, "-p", "ncframe-lathe", "--hex").out == "25 00 00 00 32 03\n"


def test_nothing_goes_out_of_a_program_with_an_error(millstream: Run, file: Path) -> None:
    file.write_bytes(b"G0 X1\nX9999999\nG2 X0 R5 F10\n")
    outcome = millstream("translate", file, "-p", "ncframe-lathe")
    assert (outcome.code, outcome.out) == (1, "")
    assert f"{file}:2:1: error: X9999998000 does not fit into a frame" in outcome.err
    assert "[frame_range]" in outcome.err
    assert f"{file}:3:" in outcome.err


def test_check_knows_the_frames_too(millstream: Run, file: Path) -> None:
    outcome = millstream("check", file, "-p", "ncframe-lathe")
    assert outcome.code == 0
    assert "5 lines, 6 blocks" in outcome.out
    assert "line ends lf" in outcome.out
    file.write_bytes(EXAMPLE)
    outcome = millstream("check", file, "-p", "ncframe-lathe", *TOLD)
    assert outcome.code == 0
    assert millstream("check", file, "-p", "ncframe-lathe").code == 1


def test_every_option_tells_the_machine_something(millstream: Run, file: Path) -> None:
    file.write_bytes(b"S400 G1 X10 F300 ; slowly\n")
    told = ("--diameter", "--feed-unit", "10", "--speed-unit", "4", "--semicolon", "remark", "--resolution", "0.01")
    assert millstream("translate", file, "-p", "ncframe-lathe", *told).out == "G1 X500 F30 S100\n"
    assert millstream("translate", file, "-p", "ncframe-lathe", *told[:-4]).code == 1


@pytest.mark.parametrize("option", [("--hex",), ("--tool-radius", "1"), ("--diameter",), ("--semicolon", "end")])
def test_options_of_frames_are_for_frames(millstream: Run, file: Path, option: tuple[str, ...]) -> None:
    outcome = millstream("translate", file, "-p", "elvinto", *option)
    assert outcome.code == 2
    assert "NC frames" in outcome.err


WRONG = (
    *(("--resolution", value) for value in ("0", "-1", "nan", "inf", "1e-300", "fine")),
    *(("--tool-radius", value) for value in ("nan", "inf", "-inf", "0,4", "")),
    *(("--compensation", value) for value in ("both", "left", "")),
    ("--feed-unit", "-1"),
    ("--feed-unit", "nan"),
    ("--speed-unit", "0"),
    ("--semicolon", "never"),
)


@pytest.mark.parametrize("command", ["translate", "check"])
@pytest.mark.parametrize("option", WRONG, ids=" ".join)
def test_numbers_that_no_machine_has_are_wrong_usage(
    millstream: Run, file: Path, command: str, option: tuple[str, str]
) -> None:
    file.write_bytes(b"G90 G41 G1 X5 Z5 F9\nX9\nM30\n")
    outcome = millstream(command, file, "-p", "ncframe-lathe", *option)
    assert (outcome.code, outcome.out) == (2, "")
    assert option[0].strip("-").replace("-", "_") in outcome.err.replace("-", "_")


def test_a_program_with_loops_is_expanded_first(millstream: Run, file: Path) -> None:
    file.write_bytes(b"G91 G1 F9\nO1 repeat [2]\nX1\nO1 endrepeat\nM30\n")
    assert millstream("translate", file, "-p", "ncframe-lathe").out.splitlines() == ["G1 F9", "X1000", "X1000", "M30"]
    file.write_bytes(b"#1=9999999\nG0 X#1\n")
    outcome = millstream("translate", file, "-p", "ncframe-lathe")
    assert outcome.code == 1
    assert f"{file}:2:" in outcome.err
    file.write_bytes(b"#1=5\nG0 X#1; Z3\n")
    outcome = millstream("translate", file, "-p", "ncframe-lathe")
    assert outcome.code == 1
    assert f"{file}:2:9: error: " in outcome.err
    assert "[block_behind_semicolon]" in outcome.err

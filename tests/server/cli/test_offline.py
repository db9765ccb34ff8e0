"""check and translate, which need no daemon."""

import json
from importlib import resources
from pathlib import Path

import pytest

from server.api.models import CheckView
from tests.server.cli.conftest import Run

GOOD = b"G21 G90 (metric)\nN10 G28\nG1 X10.000 F600\nG1 X20 F600\nM30\n"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "part.nc"
    path.write_bytes(GOOD)
    return path


def test_check_of_a_good_program_is_0(millstream: Run, file: Path) -> None:
    outcome = millstream("check", file, "--profile", "elvinto")
    assert outcome.code == 0
    assert "5 lines, 5 blocks" in outcome.out
    assert "0 errors" in outcome.out
    assert outcome.daemon.requests == []


def test_check_of_a_bad_program_is_1_and_points_at_the_place(millstream: Run, file: Path) -> None:
    file.write_bytes(GOOD + b"G20\n")
    outcome = millstream("check", file, "--profile", "elvinto")
    assert outcome.code == 1
    assert f"{file}:6:1: error: " in outcome.out


def test_check_as_json_has_the_keys_of_the_contract(millstream: Run, file: Path) -> None:
    report = json.loads(millstream("check", file, "-p", "elvinto", "--json").out)
    keys = {
        "errors",
        "warnings",
        "infos",
        "bounds",
        "seconds",
        "lines",
        "blocks",
        "cut_mm",
        "rapid_mm",
        "tools",
        "feeds",
    }
    assert set(report) >= keys
    assert set(report) == set(CheckView.model_fields)
    assert report["bounds"]["x"][1] == 20.0


def test_check_with_overrides_and_a_link(millstream: Run, file: Path) -> None:
    outcome = millstream("check", file, "-p", "elvinto", "--feed-override", "200", "--baud", "9600", "--json")
    report = json.loads(outcome.out)
    assert report["seconds_overridden"] < report["seconds"]
    assert report["link_seconds"] == report["wire_bytes"] * 10 / 9600
    outcome = millstream("check", file, "-p", "elvinto", "--rapid-override", "50")
    assert "min with the overrides" in outcome.out
    assert f"file: {len(GOOD)} bytes, ascii, line ends lf" in outcome.out


def test_check_against_a_tool_table(millstream: Run, file: Path, tmp_path: Path) -> None:
    table = tmp_path / "tool.tbl"
    table.write_text("T1 P1 D6 ;six\nT2 nonsense\n")
    file.write_bytes(b"G21 G90\nT1 M6\nT2 M6\nM30\n")
    outcome = millstream("check", file, "-p", "elvinto", "--tools", table)
    assert outcome.code == 0, "it is a warning"
    assert f"{file}:3:1: warning: T2 is not in the tool table" in outcome.out
    assert f"{table}:2: " in outcome.err
    assert millstream("check", file, "-p", "elvinto", "--tools", tmp_path / "none").code == 2


def test_check_as_json_is_1_with_errors(millstream: Run, file: Path) -> None:
    file.write_bytes(b"G999\n")
    outcome = millstream("check", file, "-p", "elvinto", "--json")
    assert outcome.code == 1
    assert json.loads(outcome.out)["errors"][0]["line"] == 1


def test_check_against_the_travel_of_a_motion_file(millstream: Run, file: Path, tmp_path: Path) -> None:
    motion = tmp_path / "motion.toml"
    motion.write_text("[motion]\ntravel = { x = [0, 15] }\n", encoding="utf-8")
    assert millstream("check", file, "-p", "elvinto").code == 0
    assert millstream("check", file, "-p", "elvinto", "--motion", motion).code == 1


def test_a_motion_file_takes_every_key_of_the_planner_and_names_what_it_does_not_know(
    millstream: Run, file: Path, tmp_path: Path
) -> None:
    motion = tmp_path / "motion.toml"
    keys = "junction_deviation = 0.02\narc_tolerance = 0.01\nplanner_blocks = 32\nlaser = true\n"
    motion.write_text(f"[motion]\nsteps_per_mm = {{ x = 80, y = 80 }}\n{keys}", encoding="utf-8")
    assert millstream("check", file, "-p", "elvinto", "--motion", motion).code == 0
    motion.write_text("[motion]\njerk = 5\n", encoding="utf-8")
    outcome = millstream("check", file, "-p", "elvinto", "--motion", motion)
    assert outcome.code == 2
    assert "motion.jerk = 5: there is no such key" in outcome.err


def test_a_faulty_motion_file_is_wrong_usage(millstream: Run, file: Path, tmp_path: Path) -> None:
    motion = tmp_path / "motion.toml"
    motion.write_text("[motion]\ntravel = { x = [15, 0] }\n", encoding="utf-8")
    outcome = millstream("check", file, "-p", "elvinto", "--motion", motion)
    assert outcome.code == 2
    assert f"{motion}: motion.travel.x = [15.0, 0.0]: allowed is [lowest, highest]" in outcome.err


@pytest.mark.parametrize("command", ["check", "translate"])
def test_an_unknown_profile_is_wrong_usage(millstream: Run, file: Path, command: str) -> None:
    outcome = millstream(command, file, "--profile", "../elvinto")
    assert outcome.code == 2
    assert "elvinto" in outcome.err


def test_inches_pass_when_converted(millstream: Run, file: Path) -> None:
    file.write_bytes(b"G20\nG28\nG1 X1 F10\nM30\n")
    assert millstream("check", file, "-p", "elvinto").code == 1
    report = json.loads(millstream("check", file, "-p", "elvinto", "--convert-inches", "--json").out)
    assert report["errors"] == []
    assert report["bounds"]["x"][1] == 25.4


def test_translate_prints_a_block_a_line(millstream: Run, file: Path) -> None:
    assert millstream("translate", file, "-p", "elvinto").out.split() == ["G21G90", "G28", "G1X10F600", "X20", "M30"]


def test_translate_without_compacting(millstream: Run, file: Path) -> None:
    out = millstream("translate", file, "-p", "elvinto", "--no-compact").out
    assert out.split() == ["G21G90", "G28", "G1X10.000F600", "G1X20F600", "M30"]


def test_translate_as_json_is_a_batch_a_line(millstream: Run, file: Path) -> None:
    batches = [json.loads(line) for line in millstream("translate", file, "-p", "elvinto", "--json").out.splitlines()]
    assert [(one["line_from"], one["line_to"], one["blocks"]) for one in batches if one["barrier"]] == [
        (2, 2, ["G28"]),
        (5, 5, ["M30"]),
    ]


def test_translate_of_a_program_that_does_not_pass_prints_nothing(millstream: Run, file: Path) -> None:
    file.write_bytes(b"G0 X1\nG20\n")
    outcome = millstream("translate", file, "-p", "elvinto")
    assert (outcome.code, outcome.out) == (1, "")
    assert f"{file}:2:1: error: " in outcome.err


def test_the_sample_program_passes_with_nothing_but_the_hint_about_homing(millstream: Run) -> None:
    with resources.as_file(resources.files("server") / "samples" / "rose.nc") as sample:
        report = json.loads(millstream("check", sample, "-p", "elvinto", "--json").out)
    assert report["errors"] == []
    assert [(one["code"], one["line"]) for one in report["warnings"]] == [("differs", 7)]
    assert report["bounds"]["x"][0] >= 0
    assert report["bounds"]["x"][1] <= 120


OWORDS = b"G21 G90\n#1=0\no1 while [#1 LT 2]\n  G1 X[#1*5] F600\n  #1=[#1+1]\no1 endwhile\nM30\n"


def test_a_program_with_o_words_is_expanded(millstream: Run, file: Path) -> None:
    file.write_bytes(OWORDS)
    outcome = millstream("check", file, "-p", "elvinto")
    assert outcome.code == 0
    assert "7 lines (expanded: 4), 4 blocks" in outcome.out
    assert f"{file}:1:0: info: " in outcome.out
    translated = millstream("translate", file, "-p", "elvinto", "--no-compact")
    assert translated.out.split() == ["G21G90", "G1X0F600", "G1X5F600", "M30"]
    batches = [json.loads(line) for line in millstream("translate", file, "-p", "elvinto", "--json").out.splitlines()]
    assert batches[-1]["line_to"] == 4


def test_a_fanuc_program_with_a_subprogram(millstream: Run, file: Path) -> None:
    file.write_bytes(b"O1\nG21 G90\nM98 P2 L2\nM30\nO2\n/G1 X1 F5\nM99\n")
    translated = millstream("translate", file, "-p", "elvinto", "--no-compact")
    assert translated.out.split() == ["G21G90", "G1X1F5", "G1X1F5", "M30"]
    without = millstream("translate", file, "-p", "elvinto", "--block-delete")
    assert without.out.split() == ["G21G90", "M30"]


@pytest.mark.parametrize(("line", "code"), [(b"G1 X#<_x>\n", "machine_parameter"), (b"M98 P7\n", "m98_target")])
def test_what_cannot_be_expanded_is_a_finding(millstream: Run, file: Path, line: bytes, code: str) -> None:
    file.write_bytes(b"G21 G90\n" + line + b"M30\n")
    outcome = millstream("check", file, "-p", "elvinto")
    assert outcome.code == 1
    assert f"{file}:2:" in outcome.out
    assert f"[{code}]" in outcome.out
    assert millstream("translate", file, "-p", "elvinto").code == 1


def test_a_binary_file_with_a_parameter_in_it_is_no_crash(millstream: Run, file: Path) -> None:
    file.write_bytes(b"\x00\x01#1=5\n")
    outcome = millstream("check", file, "-p", "elvinto", "--json")
    assert outcome.code == 1
    assert json.loads(outcome.out)["expanded_lines"] is None


def test_a_profile_of_the_users_own(millstream: Run, file: Path, tmp_path: Path) -> None:
    """A controller as elvinto, but with G20 and without G28."""
    shipped = (resources.files("gcode") / "profiles" / "elvinto.toml").read_text(encoding="utf-8")
    lines = [line for line in shipped.splitlines() if not line.startswith(("G20 =", "G28 ="))]
    own = tmp_path / "my-router.toml"
    own.write_text("\n".join(lines) + '\nG20 = { group = "units" }\n', encoding="utf-8")
    outcome = millstream("check", file, "--profile", own)
    assert outcome.code == 1
    assert "G28 does not exist" in outcome.out
    missing = millstream("check", file, "--profile", tmp_path / "not-there.toml")
    assert missing.code == 2
    assert "not-there" in missing.err
    own.write_text("name = 5\n", encoding="utf-8")
    assert millstream("check", file, "--profile", own).code == 2

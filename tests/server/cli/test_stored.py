"""settings, offsets, modal, firmware, startup-blocks: what is asked of the daemon, and what is printed."""

import json
from typing import Any

import pytest

from server.api.grblmodels import FirmwareView, ModalView, OffsetsView
from server.api.routing import example_of
from server.api.settingmodels import BACKUP_EXAMPLE, BackupView, RestoreResult, SettingsResult, SettingsView
from tests.harness.fakedaemon import problem
from tests.server.cli.conftest import Run

SETTINGS = "/machines/router/settings"


def answers(key: str, answer: Any) -> dict[str, Any]:
    return {key.replace(" ", " /machines/router", 1): answer}


def test_settings_are_listed_with_their_meaning(millstream: Run) -> None:
    found = answers("GET /settings", example_of(SettingsView))
    outcome = millstream("settings", "list", answers=found)
    assert outcome.code == 0
    assert outcome.out.splitlines()[1].split()[:4] == ["$110", "500.000", "mm/min", "X-axis"]
    assert json.loads(millstream("settings", "list", "--json", answers=found).out) == example_of(SettingsView)


def test_a_setting_in_no_table_is_listed_all_the_same(millstream: Run) -> None:
    unknown = {"number": 999, "value": "a\x1b[2J", "name": None, "unit": None, "meaning": None}
    outcome = millstream("settings", "list", answers=answers("GET /settings", {"settings": [unknown]}))
    assert "$999" in outcome.out
    assert "\x1b" not in outcome.out


@pytest.mark.parametrize(
    ("words", "values"),
    [
        (["110", "600"], {"110": "600"}),
        (["$110", "600"], {"110": "600"}),
        (["110=600", "22=1"], {"110": "600", "22": "1"}),
        (["$58=-5"], {"58": "-5"}),
        (["300", "my", "host"], {"300": "my host"}),
    ],
)
def test_settings_are_set(millstream: Run, words: list[str], values: dict[str, str]) -> None:
    outcome = millstream("settings", "set", *words, answers=answers("PATCH /settings", example_of(SettingsResult)))
    assert (outcome.code, outcome.daemon.body()) == (0, {"values": values})
    assert outcome.out.splitlines() == [
        "$110 X-axis maximum rate: 500.000 -> 600.000",
        "Backup 12 has everything as it was.",
    ]


@pytest.mark.parametrize("words", [["110"], ["fast=1"], ["110="], ["110=1", "22"], []])
def test_what_is_no_setting(millstream: Run, words: list[str]) -> None:
    assert millstream("settings", "set", *words).code == 2


def test_a_change_that_ended_half_way_shows_every_setting(millstream: Run) -> None:
    results = [
        {"number": 110, "name": "rate", "asked": "6", "before": "5", "value": "6", "status": "written"},
        {"number": 111, "name": None, "asked": "6", "before": "5", "value": "5", "status": "failed"},
        {"number": 112, "name": None, "asked": "6", "before": "5", "value": "5", "status": "not_written"},
        {"number": 113, "name": None, "asked": "5", "before": "5", "value": "5", "status": "unchanged"},
    ]
    refused = problem(409, "command_failed", "error:12.", results=results, backup=3)
    outcome = millstream("settings", "set", "110=6", answers=answers("PATCH /settings", refused))
    assert outcome.code == 1
    assert [line.strip() for line in outcome.err.splitlines()[1:]] == [
        "$110 rate: 5 -> 6",
        "$111: 5, failed",
        "$112: 5, not written",
        "$113: 5 as before",
    ]


def test_what_the_controller_has_changed_itself_is_shown(millstream: Run) -> None:
    changed = {"number": 20, "name": "soft limits", "unit": "", "before": "1", "value": "0"}
    done = {**example_of(SettingsResult), "also_changed": [changed]}
    outcome = millstream("settings", "set", "22=0", answers=answers("PATCH /settings", done))
    assert "$20 soft limits: 1 -> 0 (by the controller itself)" in outcome.out


def test_backups_are_listed_and_compared(millstream: Run) -> None:
    outcome = millstream("settings", "backups", answers=answers("GET /settings/backups", [BACKUP_EXAMPLE]))
    assert outcome.out.splitlines()[1].split()[:4] == ["12", BACKUP_EXAMPLE["at"], "change", "ann"]
    shown = answers("GET /settings/backups/12", example_of(BackupView))
    outcome = millstream("settings", "compare", 12, answers=shown)
    assert outcome.code == 0
    assert outcome.out.splitlines()[1].split() == ["$110", "X-axis", "maximum", "rate", "500.000", "600.000", "mm/min"]


@pytest.mark.parametrize("options", [[], ["--json"]])
def test_a_backup_that_cannot_be_compared_is_a_failure(millstream: Run, options: list[str]) -> None:
    view = {**example_of(BackupView), "differences": None, "not_compared": "router is disconnected."}
    outcome = millstream("settings", "compare", 12, *options, answers=answers("GET /settings/backups/12", view))
    assert outcome.code == 1
    assert "router is disconnected." in outcome.out + outcome.err


def test_a_backup_that_is_the_present_state(millstream: Run) -> None:
    view = {**example_of(BackupView), "differences": []}
    outcome = millstream("settings", "compare", 12, answers=answers("GET /settings/backups/12", view))
    assert (outcome.code, outcome.out) == (0, "The settings are those of backup 12.\n")


def test_a_backup_is_put_back(millstream: Run) -> None:
    done = {**example_of(RestoreResult), "left_out": [341]}
    outcome = millstream("settings", "restore", 12, answers=answers("POST /settings/backups/12/restore", done))
    assert outcome.code == 0
    assert "$110 X-axis maximum rate: 500.000 -> 600.000" in outcome.out
    assert "no $341" in outcome.err
    nothing = {**example_of(RestoreResult), "results": [], "backup": None}
    outcome = millstream("settings", "restore", 12, answers=answers("POST /settings/backups/12/restore", nothing))
    assert outcome.out == "Nothing was to be written.\n"


def test_offsets_are_shown(millstream: Run) -> None:
    outcome = millstream("offsets", answers=answers("GET /offsets", example_of(OffsetsView)))
    assert outcome.out.splitlines() == [
        "G54    X-120.000 Y-80.000 Z-30.000",
        "G92    X0.000 Y0.000 Z0.000",
        "TLO    Z0.000",
        "PRB    X0.000 Y0.000 Z-12.500",
    ]


@pytest.mark.parametrize(
    ("options", "body"),
    [
        (["--system", "G54", "--x", "0", "--y", "-1.5"], {"system": "G54", "mode": "here", "x": 0.0, "y": -1.5}),
        (["--system", "G55", "--absolute", "--z", "-30"], {"system": "G55", "mode": "absolute", "z": -30.0}),
        (["--system", "G28"], {"system": "G28", "mode": "here"}),
    ],
)
def test_an_offset_is_set(millstream: Run, options: list[str], body: dict[str, Any]) -> None:
    outcome = millstream("offsets", *options, answers=answers("PATCH /offsets", example_of(OffsetsView)))
    assert (outcome.code, outcome.daemon.body()) == (0, body)


def test_an_offset_is_cleared(millstream: Run) -> None:
    outcome = millstream("offsets", "--clear", "g92", answers=answers("DELETE /offsets/G92", example_of(OffsetsView)))
    assert outcome.code == 0
    assert outcome.daemon.made()[-1] == "DELETE /machines/router/offsets/G92"


@pytest.mark.parametrize("options", [["--x", "1"], ["--absolute"], ["--system", "G54", "--clear", "G92"]])
def test_half_a_wish_is_wrong_usage(millstream: Run, options: list[str]) -> None:
    assert millstream("offsets", *options).code == 2


def test_modal_groups_and_firmware(millstream: Run) -> None:
    outcome = millstream("modal", answers=answers("GET /modal", example_of(ModalView)))
    assert outcome.out.splitlines()[:2] == ["motion               G0", "coordinate_system    G54"]
    view = {**example_of(FirmwareView), "warnings": ["not locked"], "facts": {"BOARD": "Uno"}}
    outcome = millstream("firmware", answers=answers("GET /firmware", view))
    assert outcome.out.splitlines()[0] == "grbl 1.1h 20190830 MYMILL"
    assert "BOARD: Uno" in outcome.out
    assert outcome.err == "not locked\n"
    outcome = millstream("firmware", "--info", "", answers=answers("PUT /firmware/info", view))
    assert (outcome.code, outcome.daemon.body()) == (0, {"info": ""})


def test_startup_blocks(millstream: Run) -> None:
    view = {"machine": "router", "blocks": ["G21", ""], "warnings": ["executed once while written: N0"]}
    outcome = millstream("startup-blocks", answers=answers("GET /startup-blocks", view))
    assert (outcome.out, outcome.err) == ("N0 G21\nN1\n", "executed once while written: N0\n")
    stored = answers("PUT /startup-blocks", view)
    outcome = millstream("startup-blocks", "--set", "G21", "--set", "G28", "--force", answers=stored)
    assert outcome.daemon.body() == {"blocks": ["G21", "G28"], "force": True}
    refused = problem(409, "needs_force", "N1: G28 moves the machine.", warnings=["N1: G28 moves the machine"])
    outcome = millstream("startup-blocks", "--set", "G28", answers=answers("PUT /startup-blocks", refused))
    assert outcome.code == 1
    assert "--force" in outcome.err

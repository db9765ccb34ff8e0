"""The SD card of the virtual grblHAL."""

from tests.harness.grblconsole import Console

FILES = {
    "Part.nc": "G21 G90 (start)\nG1 X5 F6000\nG1 X0\nM30\nG1 X9\n",
    "open.nc": "G1 X1 F600",
    "bad.nc": "G1 X1 F600\nG2\nG1X3\n",
}


def console() -> Console:
    return Console(flavour="grblHAL", card=FILES)


def test_it_lists_its_files() -> None:
    *files, end = console().tell("$F\n")
    assert files == [f"[FILE:/{name}|SIZE:{len(FILES[name])}]" for name in ("Part.nc", "bad.nc", "open.nc")]
    assert end == "ok"
    assert "SD" in next(line for line in console().tell("$I\n") if line.startswith("[NEWOPT"))


def test_without_a_card_there_is_no_such_line() -> None:
    for flavour in ("grblHAL", "1.1h"):
        assert Console(flavour=flavour).tell("$F\n")[0].startswith("error:")


def test_a_file_is_answered_once_and_hears_nothing_until_its_end() -> None:
    machine = console()
    assert machine.tell("$F=/part.nc\n") == ["ok"]
    assert "|SD:" in machine.status()
    assert machine.tell("G1 X99\n") == []
    assert machine.rest() == ["[MSG:Pgm End]"]
    assert "SD:" not in machine.status()
    assert machine.at(0, 0, 0)
    assert [line.text for line in machine.machine.executed] == ["G21G90", "G1X5F6000", "G1X0", "M30"]
    assert machine.tell("G4P0\n") == ["ok"]


def test_a_file_without_an_end_ends_when_the_machine_stands() -> None:
    machine = console()
    machine.tell("$F=open.nc\n")
    assert machine.wait(0.05) == []
    assert machine.rest() == ["[MSG:Pgm End]"]
    assert machine.at(1, 0, 0)


def test_an_error_ends_it_with_its_line() -> None:
    machine = console()
    assert machine.tell("$F=bad.nc\n") == ["ok", "error:26 in SD file at line 2", "error:26"]
    machine.rest()
    assert machine.at(1, 0, 0)
    assert machine.tell("$F=none.nc\n") == ["error:61"]


def test_a_hold_and_a_reset_reach_it() -> None:
    machine = console()
    machine.tell("$F=Part.nc\n")
    machine.wait(0.05)
    machine.tell("!")
    machine.wait(1.0)
    assert machine.state() == "Hold:0"
    machine.tell("~")
    machine.wait(0.02)
    machine.tell("\x18")
    machine.rest()
    assert "SD:" not in machine.status()

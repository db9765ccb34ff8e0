"""Status reports and everything else that is told (grbl II.5, II.6)."""

import pytest

from tests.harness.grblconsole import Console


def names(report: str) -> list[str]:
    return [part.partition(":")[0] for part in report[1:-1].split("|")]


def test_ii_5_the_first_report_has_wco_the_second_ov_the_third_neither() -> None:
    console = Console()
    assert [names(console.status()) for _ in range(3)] == [
        ["Idle", "MPos", "FS", "WCO"],
        ["Idle", "MPos", "FS", "Ov"],
        ["Idle", "MPos", "FS"],
    ]


def test_ii_5_idle_wco_every_10_and_ov_every_10_never_in_one() -> None:
    console = Console()
    reports = [names(console.status()) for _ in range(41)]
    assert [at for at, fields in enumerate(reports) if "WCO" in fields] == [0, 10, 20, 30, 40]
    assert [at for at, fields in enumerate(reports) if "Ov" in fields] == [1, 11, 21, 31]


def test_ii_5_busy_wco_every_30_and_ov_every_20() -> None:
    console = Console()
    console.tell("G1X100F60\n")
    reports = [names(console.status()) for _ in range(61)]
    assert [at for at, fields in enumerate(reports) if "WCO" in fields] == [0, 30, 60]
    assert [at for at, fields in enumerate(reports) if "Ov" in fields] == [1, 21, 41]
    assert not any({"WCO", "Ov"} <= set(fields) for fields in reports)


def test_ii_5_wco_follows_a_change_at_once() -> None:
    console = Console()
    for _ in range(4):
        console.status()
    console.tell("G92X-1Y2\n")
    assert console.status().endswith("|WCO:1.000,-2.000,0.000>")
    assert "WCO" not in console.status()


def test_ii_5_wpos_is_mpos_less_wco() -> None:
    console = Console(dollar={10: 0})
    console.tell("G10L2P1X10Y5\nG92X1\nG43.1Z2\n")
    console.rest()
    assert console.field("WPos") == "1.000,-5.000,-2.000"
    assert console.field("MPos") is None


@pytest.mark.parametrize(
    ("mask", "expected"),
    [(0, ["Idle", "WPos", "FS"]), (1, ["Idle", "MPos", "FS"]), (2, ["Idle", "WPos", "Bf", "FS"])],
)
def test_ii_5_the_mask(mask: int, expected: list[str]) -> None:
    console = Console(dollar={10: mask})
    console.status()
    console.status()
    assert names(console.status()) == expected


def test_ii_5_bf_says_15_blocks_and_128_bytes_when_empty() -> None:
    console = Console(dollar={10: 3})
    assert console.field("Bf") == "15,128"
    console.tell("G1X1F60\nG1X2")
    assert console.field("Bf") == "14,128", "half a line is in the line buffer, not in the ring"


def test_ii_5_feed_is_the_real_one() -> None:
    console = Console()
    console.tell("M4S700\nG1X100F6000\n")
    console.wait(0.25)
    assert console.field("FS") == "3000,700"
    console.wait(0.5)
    assert console.field("FS") == "6000,700"
    console.rest()
    assert console.field("FS") == "0,700"
    assert Console(variable_spindle=False).status().startswith("<Idle|MPos:0.000,0.000,0.000|F:0|")


def test_ii_5_accessories_only_together_with_ov() -> None:
    console = Console(mist=True)
    console.tell("M3S10\nM8\nM7\n")
    reports = [console.status() for _ in range(12)]
    assert [report for report in reports if "|A:" in report] == [report for report in reports if "|Ov:" in report]
    assert all(report.endswith("|A:SFM>") for report in reports if "|A:" in report)
    console.tell("M4\nM9\n")
    assert any(console.status().endswith("|Ov:100,100,100|A:C>") for _ in range(3))
    console.tell("M5\n")
    assert not any("|A:" in console.status() for _ in range(12))


def test_ii_5_pins_only_when_some_are_active() -> None:
    console = Console(door_pin=True)
    assert console.field("Pn") is None
    for letter in "SXPZ":
        console.machine.press(letter, console.now)
    assert console.field("Pn") == "PXZS"


def test_the_plate_closes_the_probe_input() -> None:
    console = Console(probe_z=-60.0)
    assert console.field("Pn") is None
    console.tell("G0Z-10\n")
    console.rest()
    assert console.field("Pn") == "P"


def test_ii_5_inches() -> None:
    console = Console(dollar={13: 1})
    console.tell("G1X25.4F2540\n")
    console.rest()
    report = console.status()
    assert "|MPos:1.0000,0.0000,0.0000|" in report
    assert console.tell("$G\n")[0].endswith("F100.0 S0]")
    assert console.settings()[110] == "6000.000", "settings stay in mm"


def test_no_minus_before_a_zero() -> None:
    console = Console()
    console.tell("G10L2P1X-0.0001\n")
    console.rest()
    assert console.tell("$#\n")[0] == "[G54:0.000,0.000,0.000]"


def test_ii_5_line_numbers_only_when_built_in() -> None:
    console = Console(line_numbers=True, dollar={10: 3})
    assert console.field("Bf") == "14,128"
    console.tell("N120G1X10F600\nN130G1X20\n")
    assert console.field("Ln") == "120"
    console.wait(1.2)
    assert console.field("Ln") == "130"
    console.rest()
    assert console.field("Ln") is None
    console = Console()
    console.tell("N120G1X10F600\n")
    assert console.field("Ln") is None


def test_ii_6_texts() -> None:
    console = Console()
    assert console.tell("$\n") == [
        "[HLP:$$ $# $G $I $N $x=val $Nx=line $J=line $SLP $C $X $H ~ ! ? ctrl-x]",
        "ok",
    ]
    assert console.tell("$I\n") == ["[VER:1.1h.20190830:]", "[OPT:V,15,128]", "ok"]
    assert console.tell("$N\n") == ["$N0=", "$N1=", "ok"]
    assert (
        Console(mist=True, line_numbers=True, door_pin=True, homing_lock=False).tell("$I\n")[1] == "[OPT:VNM+L,14,128]"
    )


def test_ii_1_echo_builds() -> None:
    assert Console(echo=True).tell("g21 (mm)\n") == ["[echo:G21]", "ok"]

"""Drilling cycles of grblHAL."""

import pytest

from tests.harness.grblconsole import Console


def ends(*lines: str) -> list[tuple[float, float, float]]:
    console = Console(flavour="grblHAL", instant=True)
    console.tell("G0Z5\n")
    assert console.tell("".join(f"{line}\n" for line in lines)) == ["ok"] * len(lines)
    found = [move for line in console.machine.executed[1:] for move in line.moves]
    return [tuple(round(each, 3) for each in move.end) for move in found]  # type: ignore[misc]


def test_g81_back_to_the_start_or_to_r() -> None:
    assert ends("G98G81X10Z-2R1F100") == [(10, 0, 5), (10, 0, 1), (10, 0, -2), (10, 0, 5)]
    assert ends("G99G81X10Z-2R1F100", "X20") == [
        (10, 0, 5), (10, 0, 1), (10, 0, -2), (10, 0, 1), (20, 0, 1), (20, 0, -2), (20, 0, 1),
    ]  # fmt: skip


def test_g83_goes_back_with_each_peck_and_g73_backs_off_a_little() -> None:
    assert ends("G99G83Z-2R1Q2F100") == [(0, 0, 1), (0, 0, -1), (0, 0, 1), (0, 0, -2), (0, 0, 1)]
    assert ends("G98G83Z-2R1Q2F100") == [(0, 0, 1), (0, 0, -1), (0, 0, 5), (0, 0, -2), (0, 0, 5)]
    assert ends("G98G73Z-2R1Q2F100") == [(0, 0, 1), (0, 0, -1), (0, 0, -0.9), (0, 0, -2), (0, 0, 5)]


def test_pecks_smaller_than_the_way_back_end_at_the_bottom() -> None:
    found = ends("G99G73Z0R1Q0.05F100")
    assert [end[2] for end in found[1::2]] == [round(0.95 - 0.05 * nth, 3) for nth in range(20)]
    assert found[-1] == (0, 0, 1)


def test_relative_with_a_repeat() -> None:
    found = ends("G91G81X10Y0Z-3R-4L2F100")
    assert [end for end in found if end[2] == -2] == [(10, 0, -2), (20, 0, -2)]


@pytest.mark.parametrize("retract", ["G98", "G99"])
def test_further_holes_keep_the_places_of_r_and_z(retract: str) -> None:
    found = ends(f"G91{retract}G81X10Y0Z-3R-4F100", "X5", "Y1Z-2")
    assert [end for end in found if end[2] < 0] == [(10, 0, -2), (15, 0, -2), (15, 1, -1)]
    found = ends(f"G91{retract}G81X10Y0Z-3R2F100", "X5")
    assert [end for end in found if end[2] < 5] == [(10, 0, 4), (15, 0, 4)]


def test_a_repeat_under_g90_is_at_the_same_place() -> None:
    hole = [(10, 0, 1), (10, 0, -2), (10, 0, 5)]
    assert ends("G98G90G81X10Z-2R1L3F100") == [(10, 0, 5), *hole, *hole, *hole]


def test_g82_dwells_at_the_bottom() -> None:
    console = Console(flavour="grblHAL")
    console.tell("G82Z-1R1P3F600\n")
    began = console.now
    console.rest()
    assert console.now - began > 3


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("G81X1F100", 28),
        ("G83Z-1R1F100", 28),
        ("G82Z-1R1F100", 28),
        ("G18G81Z-1R1F100", 42),
        ("G81Z-1R1", 22),
        ("G81Z2R1F100", 54),
    ],
)
def test_refusals(text: str, code: int) -> None:
    assert Console(flavour="grblHAL").tell(text + "\n") == [f"error:{code}"]


def test_a_bottom_above_r_is_refused() -> None:
    assert Console(flavour="grblHAL").tell("G81Z2R1F100\n") == ["error:54"]

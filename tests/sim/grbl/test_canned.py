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


def test_g83_pecks_from_r_and_g73_backs_off_a_little() -> None:
    assert ends("G83Z-2R1Q2F100") == [
        (0, 0, 1), (0, 0, -1), (0, 0, 1), (0, 0, -0.75), (0, 0, -2), (0, 0, 5),
    ]  # fmt: skip
    assert ends("G73Z-2R1Q2F100") == [(0, 0, 1), (0, 0, -1), (0, 0, -0.75), (0, 0, -2), (0, 0, 5)]


def test_relative_with_a_repeat() -> None:
    found = ends("G91G81X10Y0Z-3R-4L2F100")
    assert [end for end in found if end[2] == -2] == [(10, 0, -2), (20, 0, -2)]


def test_g82_dwells_at_the_bottom() -> None:
    console = Console(flavour="grblHAL")
    console.tell("G82Z-1R1P3F600\n")
    began = console.now
    console.rest()
    assert console.now - began > 3


@pytest.mark.parametrize(
    ("text", "code"),
    [("G81X1F100", 28), ("G83Z-1R1F100", 28), ("G82Z-1R1F100", 28), ("G18G81Z-1R1F100", 42), ("G81Z-1R1", 22)],
)
def test_refusals(text: str, code: int) -> None:
    assert Console(flavour="grblHAL").tell(text + "\n") == [f"error:{code}"]

"""Arcs for a machine that takes ends and R in counts: what it makes of them is the arc that was meant."""

from cmath import exp
from math import pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcode.ncframe.arcs import TOLERANCE_COUNTS, Lattice, Piece, pieces
from gcode.ncframe.items import Items
from tests.harness.frameprograms import Machine
from tests.harness.programs import quick

LATTICE = Lattice(0.001)


def arc(start: complex, end: complex, centre: complex, *, clockwise: bool = False) -> list[Piece]:
    return list(pieces(LATTICE, start, end, centre, clockwise=clockwise))


def run(start: complex, made: list[Piece], *, clockwise: bool) -> Machine:
    machine = Machine()
    machine.z, machine.x = LATTICE.counts(start.real), LATTICE.counts(start.imag)
    for piece in made:
        z, x = LATTICE.counts(piece.end.real) - machine.z, LATTICE.counts(piece.end.imag) - machine.x
        machine.run(Items(g=2 if clockwise else 3, x=x, z=z, r=piece.radius_counts))
    return machine


def test_a_quarter_is_one_piece_with_a_positive_radius() -> None:
    assert arc(10 + 0j, 10j, 0j) == [Piece(10j, 10_000, 1.0)]


def test_three_quarters_are_one_piece_with_a_negative_radius() -> None:
    assert arc(10 + 0j, 10j, 0j, clockwise=True) == [Piece(10j, -10_000, 1.0)]


def test_half_a_turn_has_a_positive_radius_either_way() -> None:
    for clockwise in (True, False):
        assert arc(10 + 0j, -10 + 0j, 0j, clockwise=clockwise) == [Piece(-10 + 0j, 10_000, 1.0)]


@pytest.mark.parametrize("clockwise", [True, False])
def test_a_full_circle_is_two_halves(clockwise: bool) -> None:
    made = arc(3 + 5j, 3 + 5j, 3 + 1j, clockwise=clockwise)
    assert [(piece.radius_counts, piece.share) for piece in made] == [(4000, 0.5), (4000, 0.5)]
    assert abs(made[0].end - (3 - 3j)) < 1e-9
    assert made[1].end == 3 + 5j


def test_a_full_circle_whose_halves_would_bulge_is_more_pieces() -> None:
    start = 10 * exp(0.7j)
    made = arc(start, start, 0j)
    assert len(made) > 2
    # In two halves, a chord of less than 2R would put the centre a hundredth of a millimetre aside.
    assert sum(piece.share for piece in made) == 1.0


def test_nearly_a_full_turn_is_no_guess_of_the_direction_between_two_ends_that_nearly_meet() -> None:
    made = arc(10 + 0j, 10 * exp(-0.002j), 0j)
    machine = run(10 + 0j, made, clockwise=False)
    assert all(abs(abs(way.at(share)) - 10_000) < 3 for way in machine.ways for share in (0.2, 0.5, 0.8))
    assert sum(way.sweep for way in machine.ways) == pytest.approx(2 * pi - 0.002, abs=1e-3)


def test_ends_that_were_rounded_apart_still_have_a_radius_that_reaches() -> None:
    made = arc(0.0004 + 0j, 2.0005 + 0j, 1.00045 + 0j)
    assert all(2 * abs(piece.radius_counts) >= 2000 for piece in made)


def test_an_arc_of_less_than_a_count_is_nothing() -> None:
    assert arc(0j, 0.0001 + 0.0001j, 0.0001 + 0j) == []
    assert arc(0j, 0j, 0.0001 + 0j) == []


@quick
@given(
    st.floats(0.02, 500),
    st.floats(0, 2 * pi),
    st.floats(0.001, 2 * pi),
    st.complex_numbers(max_magnitude=200, allow_nan=False),
    st.booleans(),
)
def test_what_the_machine_makes_of_it_is_the_arc(
    radius: float, begin: float, sweep: float, centre: complex, clockwise: bool
) -> None:
    turn = -1 if clockwise else 1
    start, end = centre + radius * exp(1j * begin), centre + radius * exp(1j * (begin + turn * sweep))
    made = arc(start, end, centre, clockwise=clockwise)
    machine = run(start, made, clockwise=clockwise)
    assert (machine.z, machine.x) == (LATTICE.counts(end.real), LATTICE.counts(end.imag)) or not made
    limit = TOLERANCE_COUNTS + 1.5
    for way in machine.ways:
        for share in (0.0, 0.25, 0.5, 0.75, 1.0):
            assert abs(abs(way.at(share) - centre * 1000) - radius * 1000) < limit
    if sum(piece.share for piece in made) == 1.0 and radius * sweep > 0.1:
        turned = sum(way.sweep for way in machine.ways)
        assert abs(turned - turn * sweep) * radius * 1000 < 6 * len(made) + 2 * pi * limit

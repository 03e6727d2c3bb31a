"""Inverses of a code that are shown beside their patterns light one side of every edge twice."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.capture.proof.lasting.pair_places import PairPlaces, pair_places
from dsl_core.capture.proof.prediction import Lit
from dsl_core.capture.proof.raster import Counts
from dsl_core.model.plan import GrayCode
from dsl_core.patterns.binary_code import binary_image

SIZE, ROWS, BLACK, WHITE = (256, 36), 12, 300.0, 1500.0
CODE = GrayCode(rows=False)


def found(
    columns: int,
    pairs: tuple[int, ...] = (0, 1, 2, 3, 4, 5),
    light: float = 1.0,
    room: float = 0.0,
    power: float = 1.0,
    view: tuple[int, int] = (0, SIZE[0]),
) -> PairPlaces | None:
    """With inverses of some pairs displaced by so many columns, in so much of the light of patterns.

    ``room`` is light of the room that came after black, as a share of the light, ``power`` that by which
    counts follow the light; the camera sees the columns of the ``view``, from the first up to the last.
    """
    rng = np.random.default_rng(5)
    column = np.tile(np.arange(*view), ROWS)
    surface = WHITE * rng.uniform(0.5, 1.0, column.size)

    def seen(light: NDArray[np.float64]) -> Counts:
        wide = np.pad(light, 1, mode="edge")
        blurred = 0.25 * wide[:-2] + 0.5 * wide[1:-1] + 0.25 * wide[2:]
        counts = blurred[column] ** power * surface + BLACK + rng.normal(0, 10, column.size)
        return np.rint(counts).astype(np.uint16)

    taken = {}
    for number in range(6):
        pattern = (binary_image(CODE, SIZE, 2 * number)[0] > 0).astype(np.float64)
        inverse = light * np.roll(1 - pattern, columns if number in pairs else 0) + room
        taken[number] = seen(pattern), seen(inverse)
    ones = np.ones(column.size, np.float32)
    black, contrast = BLACK * ones, surface.astype(np.float32)
    lit = Lit(np.arange(column.size), 3 * column, black, contrast, 10 * ones)
    return pair_places(CODE, SIZE, taken, lit)


@pytest.mark.parametrize("columns", [1, -1, 2])
def test_inverses_beside_their_patterns_are_told_with_columns(columns: int) -> None:
    one = found(columns)
    assert one is not None
    assert one.columns == pytest.approx(columns, rel=0.45)
    assert f"against each other by about {abs(one.columns):.1f} columns" in one.sentence
    assert "pixel shift" in one.sentence


def test_sound_pairs_and_light_that_changed_are_no_displacement(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dsl_core.capture.proof.lasting.pair_places.FEWEST", 1)
    assert found(0) is None
    assert found(0, light=1.1) is None
    assert found(0, room=0.2) is None


def test_a_room_that_became_brighter_hides_no_displacement() -> None:
    one = found(1, room=0.5)
    assert one is not None
    assert one.columns == pytest.approx(1, rel=0.45)


def test_a_single_pair_may_have_moved_for_itself() -> None:
    assert found(1, pairs=(3,)) is None


@pytest.mark.parametrize("power", [0.45, 0.7])
def test_values_not_proportional_to_light_displace_nothing(power: float) -> None:
    # Two coarse pairs have one edge here, which rises.
    assert found(0, power=power, view=(100, 170)) is None
    one = found(1, power=power)
    assert one is not None
    assert one.columns == pytest.approx(1, rel=0.45)

"""Patterns and their inverses together are white; where they are not, light depends on how much there is."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.capture.proof.code.code_pairs import Pair
from dsl_core.capture.proof.code.code_sum import CodeSum, code_sum
from dsl_core.capture.proof.light_sums import light_sentence
from dsl_core.capture.proof.lines.line_sum import LineSum
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.prediction import Lit
from dsl_core.capture.proof.raster import Counts
from dsl_core.model.rig import Sensor

PIXELS, BLACK, WHITE = 600, 300.0, 1500.0
Camera = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def summed(
    code: float | Sequence[float | NDArray[np.float64]] = 1.0,
    camera: Camera = lambda light: light,
    pairs: int = 6,
    edges: float | NDArray[np.float64] = 0.2,
    shot: float = 0.0,
    halo: float = 0.0,
    spread: tuple[float, float] = (0.6, 1.2),
) -> CodeSum | None:
    """Of pairs with so much light each, as a camera tells it; a share of the pixels sees the edges."""
    rng = np.random.default_rng(3)

    def seen(light: NDArray[np.float64]) -> Counts:
        noise = rng.normal(0, 1, PIXELS) * np.sqrt(9 + shot**2 * WHITE * light)
        return np.rint(camera(light) + BLACK + noise).clip(0).astype(np.uint16)

    light = WHITE * rng.uniform(*spread, PIXELS)
    shares = [code] * pairs if isinstance(code, float) else code
    taken: dict[int, Pair] = {}
    for number, share in enumerate(shares):
        part = np.where(rng.random(PIXELS) < edges, rng.uniform(0.3, 0.7, PIXELS), rng.random(PIXELS) > 0.5)
        part = halo + (1 - 2 * halo) * part
        taken[number] = seen(share * part * light), seen(share * (1 - part) * light)
    white, black = seen(light), seen(0 * light)
    sensor = Sensor()
    if shot:
        sensor = Sensor(black_level_dn=BLACK, electrons_per_dn=1 / (shot**2 * WHITE), read_noise_dn=3.0)
    at, ones = np.arange(PIXELS), np.ones(PIXELS, np.float32)
    lit = Lit(at, at, black.astype(np.float32), (white - black).astype(np.float32), ones)
    return code_sum(taken, (white, black), lit, Noise(sensor))


def found(code: float | list[float] = 1.0, camera: Camera = lambda light: light) -> CodeSum:
    one = summed(code, camera)
    assert one is not None
    return one


@pytest.mark.parametrize(("share", "is_told"), [(1.0, False), (1.02, False), (1.06, True), (0.92, True)])
def test_a_code_with_another_share_of_the_light_than_white_is_told(share: float, is_told: bool) -> None:
    one = found(share)
    assert one.share == pytest.approx(share, abs=0.005)
    assert (one.is_uneven, one.is_curved) == (is_told, False)


@pytest.mark.parametrize(("share", "is_told"), [(1.0, False), (0.92, True)])
def test_noise_of_white_is_no_light_that_the_code_lacks(share: float, is_told: bool) -> None:
    one = summed(share, edges=0.0, shot=0.06, spread=(1.0, 1.0))
    assert one is not None
    assert one.share == pytest.approx(share, abs=0.015)
    assert one.is_uneven == is_told


def test_noise_of_light_beside_stripes_makes_no_edges() -> None:
    one = summed(pairs=10, edges=0.05, shot=0.12, halo=0.12, spread=(1.0, 1.0))
    assert one is not None
    assert not one.is_curved


def test_light_that_settles_while_the_code_is_captured_does_not_depend_on_the_picture() -> None:
    # The last pair, just before white, has the light of white.
    assert not found([0.8, 0.85, 0.9, 0.94, 0.98, 1.0]).is_uneven
    assert not found([0.8, 0.8, 0.8, 0.8, 0.8, 1.0]).is_uneven
    assert found([0.8, 0.8, 0.8, 0.8, 0.8, 0.8]).is_uneven


def test_a_camera_whose_counts_are_not_proportional_to_light_is_told_by_edges_of_stripes() -> None:
    gamma = found(camera=lambda light: WHITE * (light / WHITE) ** (1 / 1.8))
    assert gamma.is_curved
    assert gamma.curve == pytest.approx(0.35, abs=0.03)
    assert not gamma.is_uneven
    assert not found(1.3).is_curved


def test_colours_that_a_camera_balances_otherwise_are_no_curve() -> None:
    colour = np.arange(PIXELS) % 3
    code = [np.array([1.15, 1.0, 0.87])[colour]] * 6
    one = summed(code, edges=np.where(colour == 0, 0.5, 0.05))
    assert one is not None
    assert abs(one.curve) < 0.01


def test_of_few_pairs_pixels_or_edges_nothing_is_said() -> None:
    assert summed(pairs=2) is None
    camera: Camera = lambda light: WHITE * (light / WHITE) ** (1 / 1.8)  # noqa: E731
    sharp = summed(camera=camera, edges=0.0)
    assert sharp is not None
    assert not sharp.is_curved


def of_code(share: float, curve: float = 0.0) -> CodeSum:
    return CodeSum(share, 0.004, 0.03, curve, 0.004)


def of_lines(share: float) -> LineSum:
    return LineSum(share, 0.01, 0.1)


@pytest.mark.parametrize(
    ("code", "lines", "words"),
    [
        (
            of_code(1.3),
            of_lines(1.0),
            "together have 1.30 ± 0.01 times the light of white, and all lines 1.00",
        ),
        (of_code(1.3), None, "light of white, which they add up to. The light of the projector depends"),
        (of_code(1.0), of_lines(0.8), "projector gives dark pictures another share of its light than bright"),
        (None, of_lines(1.2), "All lines together have 1.20 ± 0.01 times the light of white, which they add"),
        (of_code(1.0), of_lines(1.2), "or the camera's values are not proportional to the light"),
        (of_code(1.0), of_lines(-0.3), "less than none, so that black was darker than in its own pictures"),
        (of_code(1.0), of_lines(1.24), "darker than the dark parts of others (dynamic black, iris), other"),
        (
            of_code(1.02, 0.3),
            of_lines(1.2),
            "1.32 ± 0.01 times the light of white, and elsewhere 1.02 times.",
        ),
    ],
)
def test_the_likeliest_cause_is_named(code: CodeSum | None, lines: LineSum | None, words: str) -> None:
    assert words in light_sentence(code, lines)


def test_a_camera_that_is_not_linear_is_no_fault_of_the_projector() -> None:
    curved = light_sentence(of_code(1.1, 0.3), of_lines(1.2))
    assert "camera's values are not proportional" in curved
    assert "how bright its picture is" not in curved


@pytest.mark.parametrize("code", [None, of_code(1.0), of_code(1.02)])
@pytest.mark.parametrize("lines", [None, of_lines(0.95), of_lines(1.05)])
def test_of_light_that_adds_up_nothing_is_said(code: CodeSum | None, lines: LineSum | None) -> None:
    assert light_sentence(code, lines) == ""

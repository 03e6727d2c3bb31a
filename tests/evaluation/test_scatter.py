"""How sure figures over a picture are: as sure as many repeats of the picture show."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from dsl_core.evaluation.scatter import mean_std, median_std, rms_std, std_of_mean, std_of_rms

FIGURES: dict[str, tuple[Callable[[np.ndarray], float | None], Callable[[np.ndarray], float]]] = {
    "rms": (rms_std, lambda image: float(np.sqrt(np.nanmean(image**2)))),
    "mean": (mean_std, lambda image: float(np.nanmean(image))),
    "median": (median_std, lambda image: float(np.nanmedian(image))),
}


MASKS = {
    "all": lambda y, x: y >= 0,
    "a disc": lambda y, x: (y - 100) ** 2 + (x - 150) ** 2 < 80**2,
    "a bit more than a block": lambda y, x: (y > 27) & (y < 70) & (x > 35) & (x < 80),
}


def repeat(seed: int, where: str) -> np.ndarray:
    """Errors alike within 5 x 5 pixels, a tenth of them unknown, the rest where a mask is."""
    rng = np.random.default_rng(seed)
    image = np.kron(rng.normal(0.1, 0.4, (40, 60)), np.ones((5, 5)))
    image[rng.random(image.shape) < 0.1] = np.nan
    image[~MASKS[where](*np.indices(image.shape))] = np.nan
    return image


@pytest.mark.parametrize("where", MASKS)
@pytest.mark.parametrize("name", FIGURES)
def test_a_deviation_is_that_of_many_repeats(name: str, where: str) -> None:
    std_of, figure = FIGURES[name]
    maps = [repeat(seed, where) for seed in range(120)]
    spread = np.std([figure(each) for each in maps], ddof=1)
    found = [std_of(each) for each in maps]
    assert np.mean([each for each in found if each is not None]) == pytest.approx(spread, rel=0.35)


def test_where_nothing_is_known_nothing_is_said() -> None:
    nothing, one = np.full((12, 16), np.nan), np.full((12, 16), np.nan)
    one[0, 0] = 0.5
    for std_of, _ in FIGURES.values():
        assert std_of(nothing) is None
        assert std_of(one) is None
    assert rms_std(np.zeros((12, 16))) is None
    assert std_of_rms([0.04]) is None
    assert std_of_mean([1.0, 3.0]) == pytest.approx(1.0)

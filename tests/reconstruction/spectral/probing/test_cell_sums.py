"""Values pooled over all pixels: found as they are, and as sure as the cells agree."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.reconstruction.spectral.probing.cell_sums import CellSums
from dsl_core.reconstruction.spectral.probing.line_probe import LineProbe
from dsl_core.reconstruction.spectral.probing.probe import Probe
from dsl_core.reconstruction.spectral.probing.probed_light import PARAMETERS

CELL = np.repeat(np.arange(48), 8)
INFORMATION = 100.0
GAIN = PARAMETERS.index("gain +1")


def probe_of(by_cell: float) -> Probe:
    """Pixels that ask for a gain of .2, cells off it by a deviation beyond noise."""
    rng = np.random.default_rng(2)
    count, p = len(CELL), len(PARAMETERS)
    wanted = rng.standard_normal((count, p)) / np.sqrt(INFORMATION)
    wanted[:, GAIN] += 0.2 + by_cell * rng.standard_normal(48)[CELL]
    return Probe(
        normal=np.broadcast_to(INFORMATION * np.eye(p), (count, p, p)).copy(), score=INFORMATION * wanted,
        bias=np.zeros((count, 1, p)), reflectance=np.ones((count, 1)), chi_square=np.ones(count),
        correlation=np.ones(count), place=np.zeros((count, 2)), cell=CELL, pixel=np.arange(count),
        lines=LineProbe(np.eye(2)[None], np.zeros((1, 2)), np.ones(1)), nm_per_px=2.0,
    )  # fmt: skip


def sums_of(probe: Probe, count: int = 1) -> CellSums:
    """The gain of the first order, and parameters before it."""
    design = np.zeros((len(CELL), len(PARAMETERS), count))
    design[:, GAIN - count + 1 : GAIN + 1] = np.eye(count)
    return CellSums.of(probe, design)


@pytest.mark.parametrize(("by_cell", "std"), [(0.0, 0.1 / np.sqrt(384)), (0.2, 0.2 / np.sqrt(48))])
def test_a_deviation_holds_the_scatter_of_cells(by_cell: float, std: float) -> None:
    fit = sums_of(probe_of(by_cell)).fit(np.array([10.0]))
    stated = float(np.sqrt(fit.covariance[0, 0]))
    assert stated == pytest.approx(std, rel=0.25)
    assert fit.values[0] == pytest.approx(0.2, abs=3 * stated)


def test_only_the_chosen_cells_count() -> None:
    probe = probe_of(0.0)
    probe.score[CELL >= 24, GAIN] *= -1
    sums = sums_of(probe)
    low, high = (sums.fit(np.array([10.0]), among).values[0] for among in (sums.cell < 24, sums.cell >= 24))
    assert (low, high) == (pytest.approx(0.2, abs=0.03), pytest.approx(-0.2, abs=0.03))


def test_sums_say_what_the_pixels_say() -> None:
    probe, values = probe_of(0.2), np.array([0.05, 0.3])
    sums = sums_of(probe, 2)
    asked = np.zeros((len(CELL), len(PARAMETERS)))
    asked[:, GAIN - 1 : GAIN + 1] = values
    fall = 2 * (asked * probe.score).sum(1) - np.einsum("np,npq,nq->n", asked, probe.normal, asked)
    assert sums.falls(values) == pytest.approx(np.bincount(CELL, probe.weight * fall))
    alone, behind = sums_of(probe).fit(np.array([10.0])), sums.tail(1).fit(np.array([10.0]))
    assert behind.values == pytest.approx(alone.values)
    assert behind.excess == pytest.approx(alone.excess)

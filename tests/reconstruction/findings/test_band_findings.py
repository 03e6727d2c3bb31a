"""Bands that are too wide for the lines, or too fine for the data, are told."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.model.fit import Fit
from dsl_core.model.plan import CapturePlan, ScanLines
from dsl_core.model.result import Reach
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.reconstruction.findings.band_findings import band_findings, line_width_nm
from dsl_core.reconstruction.findings.flag_findings import SpectralCounts, count_spectra
from dsl_core.simulation.published_rig import published_rig

SHAPE = (20, 20)


def counted(data_share: np.ndarray, reach: np.ndarray) -> SpectralCounts:
    black = np.zeros_like(data_share)
    return count_spectra(np.zeros(SHAPE, np.uint16), data_share, reach, black, black)


@pytest.mark.parametrize(("step_nm", "share", "words"), [(20, 0.9, "coarse"), (1, 0.2, "fine"), (5, 0.9, "")])
def test_bands_are_judged_by_the_lines_and_by_the_data(step_nm: float, share: float, words: str) -> None:
    cube = (3, *SHAPE)
    found = Fit.of(
        band_findings(step_nm, 11.0, counted(np.full(cube, share), np.full(cube, int(Reach.PLUS_ONE))))
    )
    assert bool(found.parts) == bool(words)
    assert words in found.words


def test_bands_that_no_line_reaches_are_not_blamed_on_their_width() -> None:
    cube = (3, *SHAPE)
    zero_only = np.full(cube, int(Reach.ZERO_ONLY))
    found = Fit.of(band_findings(5, 11.0, counted(np.full(cube, 0.1), zero_only)))
    assert "wider bands" not in found.words
    assert "No first order reaches 100% of the bands" in found.words
    assert "fewer lines per mm" in found.words


@pytest.mark.parametrize(("missed", "told"), [(0, False), (4, False), (6, True)])
def test_a_film_whose_orders_miss_the_frame_is_told(missed: int, told: bool) -> None:
    reach = np.full((10, *SHAPE), int(Reach.PLUS_ONE))
    reach[:missed] = int(Reach.ZERO_ONLY)
    found = Fit.of(band_findings(5, 11.0, counted(np.full(reach.shape, 0.9), reach)))
    assert (found.parts == ("bands",)) == told
    assert ("No first order reaches 60%" in found.words) == told
    # Pixels without a spectrum have no bands that could be missed.
    none = counted(np.full(reach.shape, np.nan), np.zeros(reach.shape, int))
    assert none.unreached == 0


def test_a_line_of_the_published_rig_is_about_ten_nanometres_wide() -> None:
    rig, grid = published_rig(), WavelengthGrid()
    depth = np.full((rig.camera.height_px, rig.camera.width_px), 700.0)
    wide, narrow = (
        line_width_nm(rig, CapturePlan(spectral=ScanLines(width_px=w, step_px=2)), grid, depth)
        for w in (5, 2)
    )
    assert wide is not None
    assert narrow == pytest.approx(0.4 * wide)
    assert 8 < wide < 14
    assert line_width_nm(rig, CapturePlan(), grid, np.full_like(depth, np.nan)) is None

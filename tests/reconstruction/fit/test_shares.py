"""Shares of limited pixels and widths of bands become findings where they are not normal."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.model.fit import Fit
from dsl_core.model.plan import CapturePlan, ScanLines
from dsl_core.model.result import Flag, Reach
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.reconstruction.fit.findings import line_width_nm
from dsl_core.reconstruction.fit.shares import band_findings, share_findings
from dsl_core.simulation.published_rig import published_rig

SHAPE = (20, 20)


def flags(flag: Flag, share: float) -> np.ndarray[tuple[int, ...], np.dtype[np.uint16]]:
    values = np.zeros(SHAPE, np.uint16)
    values.ravel()[: round(share * values.size)] = int(flag)
    return values


@pytest.mark.parametrize(
    ("flag", "limit", "part"),
    [
        (Flag.POOR_FIT, 0.4, "mixed pixels"),
        (Flag.AT_BOUND, 0.1, "light"),
        (Flag.CODES_DISAGREE, 0.1, "coverage"),
        (Flag.OUT_OF_RANGE, 0.1, "coverage"),
    ],
)
def test_a_flag_is_told_from_the_share_that_is_not_normal(flag: Flag, limit: float, part: str) -> None:
    below, above = (Fit.of(share_findings(flags(flag, limit + d), True)) for d in (-0.02, 0.02))
    assert below.parts == ()
    assert above.parts == (part,)
    assert f"{limit + 0.02:.0%}" in above.words


def test_pixels_in_shadow_are_not_lost_and_depth_alone_has_no_spectra_to_judge() -> None:
    assert Fit.of(share_findings(flags(Flag.NO_LIGHT, 0.8), True)).parts == ()
    assert Fit.of(share_findings(flags(Flag.POOR_FIT, 0.8), False)).parts == ()


@pytest.mark.parametrize(("step_nm", "share", "words"), [(20, 0.9, "coarse"), (1, 0.2, "fine"), (5, 0.9, "")])
def test_bands_are_judged_by_the_lines_and_by_the_data(step_nm: float, share: float, words: str) -> None:
    cube = (3, *SHAPE)
    found = Fit.of(
        band_findings(step_nm, 11.0, np.full(cube, share), np.full(cube, int(Reach.PLUS_ONE), np.uint8))
    )
    assert bool(found.parts) == bool(words)
    assert words in found.words


def test_bands_that_no_line_reaches_are_not_blamed_on_their_width() -> None:
    cube = (3, *SHAPE)
    zero_only = np.full(cube, int(Reach.ZERO_ONLY), np.uint8)
    assert Fit.of(band_findings(5, 11.0, np.full(cube, 0.1), zero_only)).parts == ()


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

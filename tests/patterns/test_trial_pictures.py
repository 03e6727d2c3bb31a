from __future__ import annotations

import numpy as np
import pytest

from dsl_core.errors import PlanError
from dsl_core.patterns.trial_pictures import KINDS, PictureKind, trial_picture


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_is_a_picture_of_the_projector(kind: PictureKind) -> None:
    picture = trial_picture(kind, (64, 36), 0.5)
    assert picture.shape == (36, 64, 3)
    assert picture.dtype == np.uint8
    assert picture.max() == (0 if kind == "black" else 128)


def test_the_checker_alternates_from_pixel_to_pixel() -> None:
    picture = trial_picture("checker", (8, 4))[..., 0].astype(int)
    assert (np.abs(np.diff(picture, axis=0)) == 255).all()
    assert (np.abs(np.diff(picture, axis=1)) == 255).all()


def test_the_line_stands_where_it_was_asked() -> None:
    lit = trial_picture("line", (64, 36), column_px=60)[0, :, 0] > 0
    assert np.flatnonzero(lit).tolist() == [60, 61, 62, 63]


def test_the_ramp_holds_all_levels() -> None:
    assert np.unique(trial_picture("ramp", (640, 4))).size == 256


def test_impossible_levels_are_told() -> None:
    with pytest.raises(PlanError, match="between 0 and 1, not 2"):
        trial_picture("white", (8, 8), 2.0)

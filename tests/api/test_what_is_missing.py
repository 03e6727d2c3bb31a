"""What results say that lack a variable, and of places that hold a single pixel."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import dsl_core as dsl
from tests.cases.small_result import small_result


def test_a_region_of_one_pixel_states_what_is_stated_for_it(tmp_path: Path) -> None:
    result = dsl.load_result(dsl.save_result(small_result(), tmp_path / "a.zarr"))
    pixel, other = result.dsl.spectrum(4, 2), result.dsl.spectrum(6, 3)
    region = result.dsl.region((4, 2, 1, 1))
    np.testing.assert_allclose(region["reflectance_std"], pixel["reflectance_std"])
    for name in ("most_sigmas", "differ"):
        found, known = (each.dsl.difference(other).attrs[name] for each in (region, pixel))
        assert found == pytest.approx(known)
    region.dsl.export(tmp_path / "region.csv")
    text = (tmp_path / "region.csv").read_text("utf-8")
    assert "deviation of its pixels" not in text
    assert "uncertainty of a pixel" in text

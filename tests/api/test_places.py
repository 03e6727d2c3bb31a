"""Places of a picture as scripts say them: what they mark is what they name."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

import dsl_core as dsl
import dsl_core.api.accessor
from dsl_core.api.places import Place, place_mask
from dsl_core.errors import DecodeError
from tests.cases.small_result import OF_COLOUR_NM, small_result


def _box(result: xr.Dataset) -> xr.DataArray:
    """A rectangle as xarray makes it, by its coordinates: its axes are x, y."""
    found: xr.DataArray = (result.x >= 2) & (result.x < 5) & (result.y >= 1) & (result.y < 3)
    return found


def _square() -> xr.Dataset:
    result = small_result(OF_COLOUR_NM)
    side = min(result.sizes["x"], result.sizes["y"])
    return result.isel(x=slice(0, side), y=slice(0, side))


def test_a_mask_of_xarray_marks_the_pixels_that_its_coordinates_say() -> None:
    result = _square()
    mask = _box(result)
    assert mask.dims == ("x", "y")
    wanted = result.dsl.region((2, 1, 3, 2))
    upside_down = result.isel(y=slice(None, None, -1))
    for each, where in ((result, mask), (upside_down, mask), (result, _box(upside_down))):
        xr.testing.assert_allclose(each.dsl.region(where), wanted)
    pins: dict[str, Place] = {"a": mask, "b": (5, 4)}
    by_box: dict[str, Place] = {"a": (2, 1, 3, 2), "b": (5, 4)}
    xr.testing.assert_identical(dsl.colours(result, pins, "D65"), dsl.colours(result, by_box, "D65"))
    found, known = (dsl.classify(result, pins=each, measure="angle") for each in (pins, by_box))
    xr.testing.assert_identical(found, known)


def test_what_numpy_masks_marks_no_pixel() -> None:
    """Comparing a masked array leaves any value where it is masked."""
    result = small_result()
    depth_mm = np.nan_to_num(result["depth_mm"].values, nan=700.0)
    far = np.ma.masked_less(depth_mm, 705.0) > 0
    assert far.data.all()
    np.testing.assert_array_equal(place_mask(result, far), depth_mm >= 705.0)
    with pytest.raises(DecodeError, match="whole pixels"):
        place_mask(result, np.ma.array([2, 1, 3, 2], mask=[False, False, False, True]))


def test_a_mask_of_the_whole_picture_marks_a_part_of_it() -> None:
    result = small_result()
    part = result.isel(x=slice(1, 6), y=slice(1, 4))
    np.testing.assert_array_equal(place_mask(part, _box(result)), place_mask(part, (2, 1, 3, 2)))


def test_a_mask_of_another_part_is_refused() -> None:
    result = small_result()
    one, other = (result.isel(x=slice(start, start + 3)) for start in (0, 2))
    with pytest.raises(DecodeError, match=r"its x goes from 2 to 4, that of the result from 0 to 2"):
        one.dsl.region(other.dsl.good)
    with pytest.raises(DecodeError, match="axes of the mask are wavelength_nm, y, x"):
        one.dsl.region(one["reflectance"] > 0.1)


def test_a_mask_without_coordinates_marks_rows_and_columns_as_they_come() -> None:
    part = small_result().isel(x=slice(2, 6))
    mask = np.zeros((part.sizes["y"], 4), bool)
    mask[1, 2] = True
    for where in (mask, xr.DataArray(mask), xr.DataArray(mask.T, dims=("x", "y"))):
        np.testing.assert_array_equal(place_mask(part, where), mask)

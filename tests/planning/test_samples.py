"""Samples of a plane are the same few pixels however they are asked, and cost little for large pictures."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.model.rig import FlatField, Rig
from dsl_core.optics.correspondence import zero_order
from dsl_core.optics.shading import Plane, plane_shading
from dsl_core.planning.samples import plane_samples, scene_samples
from dsl_core.simulation.published_rig import published_rig

DEPTH_MM = 700.0


def test_large_pictures_are_asked_at_some_pixels(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = published_rig()
    large = rig.model_copy(update={"camera": rig.camera.resized(4096, 3000)})
    traced = list[int]()

    def counted(rig: Rig, pixels: Tensor, depth: Tensor) -> tuple[Tensor, Tensor]:
        traced.append(len(pixels))
        return zero_order(rig, pixels, depth)

    monkeypatch.setattr("dsl_core.planning.samples.zero_order", counted)
    few, many = (plane_samples(each, DEPTH_MM) for each in (rig, large))
    assert traced[0] == 890 * 580, "every pixel of the twin"
    assert traced[1] < 4e5
    assert len(many.pixels) == len(few.pixels)
    assert many.lit_share == pytest.approx(few.lit_share, abs=0.02)
    rows, columns = np.divmod(many.pixels, 4096)
    assert set(zip(rows % 2, columns % 2, strict=True)) == {(0, 0), (0, 1), (1, 0), (1, 1)}
    # The same places, to within the few pixels that are not asked.
    for at, wanted, size, known in zip(
        (rows, columns), np.divmod(few.pixels, 890), (3000, 4096), (580, 890), strict=True
    ):
        assert np.abs(np.sort(at / size) - np.sort(wanted / known)).max() < 0.02


def test_samples_have_depth_and_shading_of_their_plane() -> None:
    rig = published_rig()
    rig = rig.model_copy(update={"camera": rig.camera.resized(160, 104)})
    found = plane_samples(rig, DEPTH_MM)
    plane = Plane(np.array([0.0, 0.0, 1 / DEPTH_MM]))
    assert found.depth_mm == pytest.approx(DEPTH_MM)
    assert found.shading == pytest.approx(plane_shading(rig, plane).ravel()[found.pixels], rel=1e-9)


def test_samples_get_as_much_light_as_the_camera_s_lens_lets_through() -> None:
    rig = published_rig()
    rig = rig.model_copy(update={"camera": rig.camera.resized(160, 104)})
    field = FlatField(rows_px=(0.0, 103.0), columns_px=(0.0, 159.0), gain=((0.2, 0.4), (0.6, 0.8)))
    even, found = (plane_samples(each) for each in (rig, rig.model_copy(update={"flat_field": field})))
    rows, columns = np.divmod(found.pixels, 160)
    assert found.shading == pytest.approx(even.shading * (0.2 + 0.4 * rows / 103 + 0.2 * columns / 159))


def look_of(nm: NDArray[np.float64], **attributes: str) -> xr.Dataset:
    shape = (10, 16)
    return xr.Dataset(
        {
            "depth_mm": (("y", "x"), np.full(shape, DEPTH_MM)),
            "shading": (("y", "x"), np.full(shape, 0.8)),
            "flags": (("y", "x"), np.zeros(shape, np.uint32)),
            "reflectance": (("wavelength_nm", "y", "x"), np.full((len(nm), *shape), 0.3)),
        },
        coords={"wavelength_nm": nm},
        attrs=attributes,
    )


def small() -> Rig:
    rig = published_rig()
    return rig.model_copy(update={"camera": rig.camera.resized(16, 10)})


@pytest.mark.parametrize(("bands", "its_own"), [(range(430, 661, 10), True), (range(450, 471, 2), False)])
def test_spectra_of_a_look_stand_only_for_bands_that_it_has(bands: range, its_own: bool) -> None:
    found = scene_samples(small(), look_of(np.array(bands, float)))
    assert found.depth_mm == pytest.approx(DEPTH_MM)
    assert (found.spectra is not None) == its_own


@pytest.mark.parametrize(
    ("told", "wanted"),
    [
        ("[0.5, 1, 2]", (0.5, 1.0, 2.0)),
        ("[0.5, 1]", None),
        ("[0.5, 1, NaN]", None),
        ("[[1], 2, 3]", None),
        ("bright", None),
    ],
)
def test_a_look_tells_how_bright_its_room_is(told: str, wanted: tuple[float, ...] | None) -> None:
    nm = np.arange(430.0, 661.0, 10.0)
    found = scene_samples(small(), look_of(nm, black_dn_per_ms=told))
    assert found.black_dn_per_ms == wanted
    assert found.part(np.array([0])).black_dn_per_ms == wanted
    assert scene_samples(small(), look_of(nm)).black_dn_per_ms is None

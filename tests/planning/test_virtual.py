"""What virtual pixels make of errors in depth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
import torch
from torch import Tensor

from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.pinhole import pixel_rays
from dsl_core.optics.shading import Plane, plane_shading
from dsl_core.planning.samples import _of_plane
from dsl_core.planning.tilt import tilt_std
from dsl_core.planning.virtual import Draw, VirtualPixels
from dsl_core.reconstruction.columns.column import Column
from dsl_core.reconstruction.surface import reconstruct_surface
from dsl_core.simulation.published_rig import published_rig
from tests.cases.crop import cropped_rig

COUNT = 4000


@dataclass(frozen=True)
class Steady(Draw):
    """Noise that is everywhere the same."""

    size: float = 0.0

    def normal(self, shape: torch.Size | tuple[int, ...]) -> Tensor:
        """The noise, in its deviations."""
        return torch.full(shape, self.size, dtype=torch.float64)


def steady(size: float) -> Draw:
    """A draw of nothing but noise of a size."""
    x = torch.zeros(1)
    return Steady(x, x, x, x, x, x, x, x, x, x, torch.Generator(), 1, size)


def virtual(rig: Rig, window_px: int) -> VirtualPixels:
    plan = CapturePlan(code=GrayCode(rows=False), spectral=ScanLines(width_px=8, step_px=8))
    view = _of_plane(rig, 700.0, np.array([290 * 890 + 200, 290 * 890 + 700]), 1.0)
    return VirtualPixels(rig, plan, WavelengthGrid(step_nm=10.0), view, surface_window_px=window_px)


def test_the_last_column_of_a_picture_is_as_far_from_its_neighbour_as_others() -> None:
    rig = published_rig()
    rig = rig.model_copy(update={"camera": rig.camera.resized(24, 18)})
    view = _of_plane(rig, 700.0, 24 * 9 + np.array([22, 23]), 1.0)
    plan = CapturePlan(code=GrayCode(rows=False), spectral=ScanLines(step_px=4))
    pixels = VirtualPixels(rig, plan, WavelengthGrid(step_nm=10.0), view)
    assert pixels.pitch_px[0] == pytest.approx(float(pixels.pitch_px[1]), rel=0.05)


def column_of(std_px: Tensor) -> Column:
    flat = std_px.flatten()
    return Column(
        flat,
        flat,
        flat,
        flat,
        torch.ones_like(flat, dtype=torch.bool),
        torch.zeros_like(flat, dtype=torch.bool),
        torch.zeros_like(flat, dtype=torch.bool),
    )


def test_shading_falls_with_the_square_of_the_distance_and_with_the_slope_of_the_surface() -> None:
    rig = published_rig().model_copy(update={"column_std_px": 0.0})
    pixels = virtual(rig, window_px=9)
    error_mm = torch.tensor([[0.3, -0.2, 0.1], [0.0, 0.5, -0.4]], dtype=torch.float64)
    same_std = column_of(torch.full_like(error_mm, 0.05))
    found = pixels._shading_error(steady(1.0), same_std, error_mm)
    # Where the surface faces the projector a wrong slope changes nothing in first order.
    distance = 2 * error_mm / pixels.depth[:, None]
    slope = (error_mm / pixels.depth[:, None]).square().mean(1).sqrt() * rig.camera.fx_px
    slope *= (12 / 80) ** 0.5 / 9
    tilt = slope * torch.as_tensor(pixels.view.incidence_tan)
    assert torch.allclose(found, distance + tilt[:, None], rtol=1e-9)
    assert float((tilt / distance.abs().amax(1)).min()) > 0.1, "both terms count"


def test_relative_error_of_depth_counts_twice_as_the_inverse_square_law_has_it() -> None:
    """By moving a plane, without the formula."""
    rig = published_rig()
    here, nearer = (
        plane_shading(rig, Plane(np.array([0.0, 0.0, 1 / depth_mm]))) for depth_mm in (700.0, 699.0)
    )
    pixel = 290, 445
    relative = here[pixel] / nearer[pixel] - 1
    pixels = virtual(rig, window_px=9)
    error_mm = torch.full((2, 1), -1.0, dtype=torch.float64)
    found = pixels._shading_error(steady(0.0), column_of(torch.full((2, 1), 0.05)), error_mm)
    assert float(found[0, 0]) == pytest.approx(relative, rel=0.15)


def test_slopes_of_plane_fits_spread_as_stated() -> None:
    """Against the surface fit itself, on a plane with noise in depth."""
    window_px, depth_mm, size = 9, 700.0, (72, 60)
    rig = cropped_rig((400, 250), size)
    noise_mm = 0.2
    rng = np.random.default_rng(5)
    depth = depth_mm + noise_mm * rng.standard_normal(size[::-1])
    surface = reconstruct_surface(rig, depth, np.full_like(depth, noise_mm), window_px)
    slope = surface.normals[0] / surface.normals[2]
    inner = slope[8:-8, 8:-8]
    rays = pixel_rays(rig.camera)
    assert np.isfinite(inner).all()
    assert rays.shape[1:] == depth.shape
    relative = torch.as_tensor(noise_mm / depth_mm * rng.standard_normal((1, COUNT)))
    stated = tilt_std(relative, torch.full((1, COUNT), 0.05), rig.camera.fx_px, window_px)
    assert float(stated) == pytest.approx(float(inner.std()), rel=0.25)


def test_pixels_of_uncertain_columns_hardly_tilt_a_surface() -> None:
    relative = torch.tensor([[1e-4, -1e-4, 1e-2]], dtype=torch.float64)
    weighed = tilt_std(relative, torch.tensor([[0.05, 0.05, 5.0]]), 1761.0, 9)
    certain = tilt_std(relative[:, :2], torch.tensor([[0.05, 0.05]]), 1761.0, 9)
    # A fit over as many pixels of which a third say nothing.
    assert float(weighed) == pytest.approx(1.5**0.5 * float(certain), rel=0.01)

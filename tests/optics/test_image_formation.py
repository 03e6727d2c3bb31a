"""The forward operator: matrix, closed form, and the twin's renderer."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dsl_core.model.rig import ProjectorResponse, Rig
from dsl_core.optics.correspondence import GratingModel
from dsl_core.optics.image_formation import BlurredProfiles, ImageFormation, OrderPath
from dsl_core.optics.lines.profile import band_profile
from dsl_core.optics.spectra import hat_moments
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.rendering.renderer import Renderer
from dsl_core.simulation.scenes.catalogue import make_scene

BANDS_NM = np.arange(400.0, 701.0, 5.0)


def paths_of(rig: Rig, pixels: torch.Tensor, depth: torch.Tensor) -> list[OrderPath]:
    """Zero and first orders of a rig at some pixels."""
    paths = []
    for order in (0, 1, -1):
        moments, centroids = hat_moments(rig, order, BANDS_NM, 5.0)
        footprint = GratingModel(rig).trace(pixels, depth, order, centroids)
        columns, inside = footprint.columns, footprint.inside(640, 360)
        half = float((columns[-1] - columns[0]).abs().mean()) / 300 * 5
        if order == 0:
            columns, inside, half = columns[:1], inside[:1], 0.0
        paths.append(OrderPath(columns, inside, moments, half))
    return paths


def random_operator() -> ImageFormation:
    rng = np.random.default_rng(0)
    pixels = torch.as_tensor(rng.integers(0, 890 * 580, 12))
    depth = torch.as_tensor(rng.uniform(600, 900, 12))
    shading = torch.as_tensor(rng.uniform(0.3, 1, 12))
    rig = published_rig()
    profiles = rng.random((7, 640, 3))
    return ImageFormation(rig.projector_response, profiles, paths_of(rig, pixels, depth), shading)


def test_matrix_is_the_operator() -> None:
    form = random_operator()
    h = torch.rand((form.bands, 12), generator=torch.Generator().manual_seed(2), dtype=torch.float64)
    by_matrix = torch.einsum("pcfj,jp->cfp", form.matrix(), h)
    assert (by_matrix - form.forward(h)).abs().max() < 1e-12 * float(by_matrix.abs().max())


def test_one_band_through_one_order_has_the_closed_form() -> None:
    response = ProjectorResponse(blur_px=0.8)
    profiles = np.zeros((2, 40, 3))
    profiles[0, 10:15] = (1.0, 0.5, 0.0)
    profiles[1, 30:35] = 1.0
    moments = np.arange(9.0).reshape(3, 3, 1) + 1
    column = torch.tensor([[12.875]], dtype=torch.float64)
    path = OrderPath(column, torch.ones((1, 1), dtype=torch.bool), moments, 2.4)
    shading = torch.tensor([0.7], dtype=torch.float64)
    seen = ImageFormation(response, profiles, [path], shading).forward(
        torch.tensor([[0.3]], dtype=torch.float64)
    )
    # 12.875 is a sample of the table, so that nothing is interpolated; the line's centre is column 12.
    light = float(band_profile(np.array([0.875]), 5.0, 0.8, 2.4)[0])
    expected = 0.7 * 0.3 * light * (moments[:, 0, 0] + 0.5 * moments[:, 1, 0])
    assert seen[:, 0, 0].numpy() == pytest.approx(expected, rel=1e-9)
    assert seen[:, 1].abs().max() < 1e-9


def test_light_from_outside_the_frame_does_not_count() -> None:
    path = OrderPath(torch.tensor([[5.0]]), torch.zeros((1, 1), dtype=torch.bool), np.ones((3, 3, 1)), 1.0)
    form = ImageFormation(ProjectorResponse(), np.ones((1, 10, 3)), [path], torch.ones(1))
    assert not form.forward(torch.ones((1, 1))).any()


def test_wide_light_is_not_changed_by_blur() -> None:
    blurred = BlurredProfiles(ProjectorResponse(), np.ones((1, 60, 3)), 2.4, torch.zeros(1))
    assert blurred.at(torch.tensor([25.0, 33.3])).numpy() == pytest.approx(1.0, abs=1e-6)


def test_operator_sees_what_the_twin_renders() -> None:
    rig = published_rig()
    small = rig.model_copy(
        update={
            "camera": rig.camera.resized(64, 42),
            "projector_response": rig.projector_response.model_copy(update={"black_fraction": 0.0}),
        }
    )
    truth = make_scene("plane", reflectance=0.6).render(small.camera, small.pose.projector_centre_mm)
    twin = Renderer(small, truth)
    starts = range(150, 500, 40)
    profiles = np.zeros((len(starts), 640, 3))
    rendered = []
    for frame, start in enumerate(starts):
        image = np.zeros((360, 640, 3), np.uint8)
        image[:, start : start + 5] = 255
        profiles[frame, start : start + 5] = 1
        rendered.append(twin.expected(image)[20, 33])
    flat = torch.tensor([20 * 64 + 33])
    paths = paths_of(small, flat, torch.tensor([700.0], dtype=torch.float64))
    shading = twin.shading[twin.pixels == flat].double()
    seen = ImageFormation(small.projector_response, profiles, paths, shading).forward(
        torch.full((len(BANDS_NM), 1), 0.6, dtype=torch.float64)
    )
    # An even row and an odd column of RGGB are green.
    difference = np.abs(seen[1, :, 0].numpy() - np.array(rendered)) / np.array(rendered)
    assert difference.max() < 0.03
    assert max(rendered) > 20 * min(rendered) > 0


def test_columns_far_outside_see_the_ends_of_the_table() -> None:
    blurred = BlurredProfiles(
        ProjectorResponse(), np.ones((1, 10, 1)), 1.0, torch.zeros(1, dtype=torch.float64)
    )
    count = len(blurred.table)
    assert count == 4 * (10 + 2 * 16)
    blurred.table = torch.arange(count, dtype=torch.float64)[:, None, None]
    columns = torch.tensor([-1e6, -16.375, 0.0, 3.3, 1e6], dtype=torch.float64)
    # Four samples a column, the first of them an eighth inside the margin's edge.
    wanted = [0.0, 0.0, 4 * 16.5 - 0.5, 4 * 19.8 - 0.5, count - 1.001]
    assert blurred.at(columns)[:, 0, 0].tolist() == pytest.approx(wanted)

"""Columns of pixels, and how far all frames of a pixel may be off its dark light."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.lines.profile import zero_order_profile
from dsl_core.reconstruction.columns.maps import ColumnFinder
from dsl_core.reconstruction.hdr import MergedFrame
from dsl_core.reconstruction.merge import LineStack
from dsl_core.simulation.published_rig import published_rig

LINES = LineSet(width_px=5, step_px=2, first_px=2.0, lines=318, frames=318)
SHAPE, BLACK_STD = (4, 6), 0.02
PIXELS = SHAPE[0] * SHAPE[1]


@pytest.mark.parametrize(("step_dn", "open_std"), [(1, 0.0), (16, BLACK_STD)])
def test_frames_rounded_to_coarse_steps_leave_the_dark_light_open(step_dn: int, open_std: float) -> None:
    rig = published_rig()
    rig = rig.model_copy(
        update={
            "camera": rig.camera.resized(SHAPE[1], SHAPE[0]),
            "sensor": rig.sensor.model_copy(update={"step_dn": step_dn}),
        }
    )
    column = np.linspace(300, 340, PIXELS)
    away = torch.as_tensor(column - (LINES.first_px + LINES.step_px * np.arange(LINES.lines))[:, None])
    half = LINES.width_px / 2
    light = zero_order_profile(away, -half, half, rig.projector_response).numpy().astype(np.float32)
    frames, black = light.reshape(-1, *SHAPE), np.full(SHAPE, BLACK_STD, np.float32)
    stack = LineStack(frames, np.full_like(frames, 0.003), black)
    white = MergedFrame(np.ones_like(black), np.full_like(black, 1e-5), np.zeros(SHAPE, bool))
    start = np.round(column).astype(np.float32)
    maps = ColumnFinder(rig, white, stack, LINES, np.ones((1, 1))).find(np.arange(PIXELS), start)
    assert maps.refined.all()
    assert maps.offset_std == pytest.approx(open_std)

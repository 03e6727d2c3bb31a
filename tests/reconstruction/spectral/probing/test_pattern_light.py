"""The light of probed pixels where orders share frames, and its changes, against the forward model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import Tensor

from dsl_core.optics.colour_neighbours import bayer_colours
from dsl_core.optics.correspondence import Footprint
from dsl_core.optics.pixel_model import PixelModel, Traced
from dsl_core.optics.spectra import ORDERS
from dsl_core.reconstruction.spectral.probing.pattern_light import PatternLight
from dsl_core.reconstruction.spectral.probing.picked_cube import PickedCube
from dsl_core.reconstruction.spectral.probing.probed_light import (
    PARAMETERS,
    SECOND,
    ProbedScan,
    along_bands,
    second_share,
)
from dsl_core.reconstruction.spectral.solving.prior import Prior
from dsl_core.reconstruction.spectral.solving.tile_frames import Pixels
from tests.optics.test_pixel_model import COLOURS, COMB, random, some_model

SHAPE, AMPLITUDE, STD = (580, 890), 3.0, 0.01


def scan_of(model: PixelModel, at: Tensor, depth: Tensor, **known: float) -> ProbedScan:
    """A scan whose frames are dark, with maps that know only some pixels."""
    maps = {
        name: np.full(SHAPE, known.get(name, np.nan), np.float32)
        for name in Pixels.__dataclass_fields__
        if name != "valid"
    }
    maps["depth_mm"].ravel()[at] = depth
    maps["column_px"].ravel()[at] = model.trace(at, depth).column_px
    pixels = Pixels(**maps, valid=np.isfinite(maps["depth_mm"]))
    radiance, std = np.zeros((2, len(model.profiles), len(at)), np.float32)
    std[:] = STD
    lit, unsure = (PickedCube(each, at.numpy(), SHAPE[1]) for each in (radiance, std))
    return ProbedScan(model, pixels, lit, unsure, Prior(), direct_error=0.0)


def seen(model: PixelModel, traced: Traced, nodes: Tensor, colour: Tensor) -> Tensor:
    """Light of the samples' own colours, (samples, frames)."""
    of_colours = model.operator(traced, torch.ones_like(traced.column_px)).forward(nodes.T)
    return of_colours[colour, :, torch.arange(len(colour))]


def displaced(traced: Traced, order: int, by_px: Tensor | float) -> Traced:
    """An order of one side displaced, and the second one of that side twice as far."""
    orders = {
        m: Footprint(f.columns + (abs(m) * by_px if m * order > 0 else 0.0), f.rows)
        for m, f in traced.orders.items()
    }
    return replace(traced, orders=orders)


@pytest.mark.parametrize("spectral", [COMB, COLOURS], ids=["grey", "colours"])
def test_changes_are_those_of_the_forward_model(spectral: object) -> None:
    model, at, depth = some_model(spectral)  # type: ignore[arg-type]
    known = {"offset": 0.0, "offset_std": 0.0, "amplitude": AMPLITUDE, "shading": 1.0}
    scan = scan_of(model, at, depth, **known)
    light, nodes = PatternLight(scan, at.numpy()), random(5, model.bands.count)
    colour = torch.as_tensor(bayer_colours(model.rig.sensor.bayer, *np.divmod(at.numpy(), SHAPE[1])))
    column = torch.as_tensor(scan.pixels.column_px.ravel()[at], dtype=torch.float64)
    traced = model.trace(at, depth.float().double(), column)
    own = seen(model, traced, nodes, colour)
    assert torch.allclose((nodes[:, None] @ light.rows)[:, 0], own, rtol=1e-9)
    assert light.weight.numpy() == pytest.approx(STD**-2, rel=1e-6)
    assert torch.equal(light.colour, colour)
    found = light.changes(nodes)
    assert found.shape == (5, len(model.profiles), len(PARAMETERS))
    along = torch.as_tensor(along_bands(model))[:, None]
    for side, order in enumerate((1, -1)):
        for shape, index in ((torch.ones_like(along), side), (along, PARAMETERS.index("stretch +1") + side)):
            low, high = (
                seen(model, displaced(traced, order, step * shape), nodes, colour) for step in (-0.05, 0.05)
            )
            assert torch.allclose(found[..., index], (high - low) / 0.1, atol=2e-3 * float(own.max()))
        without = replace(traced, orders={m: f for m, f in traced.orders.items() if m != order})
        assert torch.allclose(found[..., 2 + side], own - seen(model, without, nodes, colour), atol=1e-9)
    without = replace(traced, orders={m: f for m, f in traced.orders.items() if m in ORDERS})
    seconds = own - seen(model, without, nodes, colour)
    assert torch.allclose(second_share(model) * found[..., SECOND], seconds, atol=1e-9)
    wider = model.rig.projector_response.of_width(1.05 * model.rig.projector_response.blur_px)
    rig = model.rig.model_copy(update={"projector_response": wider})
    blurred = PixelModel(rig, model.bands, model.profiles, model.correspondence, model.lines)
    gained = (seen(blurred, traced, nodes, colour) - own) / 0.05
    assert torch.allclose(found[..., 4], gained, atol=1e-9)
    frames = len(model.profiles)
    time = (torch.arange(frames) + 0.5) / frames - 0.5
    assert torch.allclose(found[..., PARAMETERS.index("drift")], own * time)


def test_an_offset_that_frames_share_is_taken_out_of_all() -> None:
    model, at, depth = some_model()
    sure, unsure = (
        PatternLight(
            scan_of(model, at, depth, offset=0.5, offset_std=std, amplitude=AMPLITUDE, shading=1.0),
            at.numpy(),
        )
        for std in (0.0, 1e3)
    )
    assert sure.values.numpy() == pytest.approx(-0.5, abs=1e-6)
    for values in (unsure.values, unsure.rows, unsure.changes(random(5, model.bands.count)).mT):
        mean = (values * unsure.weight.reshape(5, *(1,) * (values.ndim - 2), -1)).sum(-1)
        assert float(mean.abs().max()) < 1e-5 * float(unsure.weight.sum(1).max())


def test_frames_with_a_bright_zero_order_weigh_less() -> None:
    model, at, depth = some_model()
    known = {"offset": 0.0, "offset_std": 0.0, "amplitude": AMPLITUDE, "shading": 1.0}
    scan = scan_of(model, at, depth, **known)
    usual, unsure = (PatternLight(replace(scan, direct_error=e), at.numpy()).weight for e in (0.0, 0.05))
    brightest = unsure.amin(1)
    assert float((unsure / usual).max()) > 0.9
    # The zero order of a comb's lines has nearly all of the light of white.
    expected = 1 / (STD**2 + (0.05 * AMPLITUDE) ** 2)
    assert float((brightest / expected).min()) == pytest.approx(1.0, abs=0.1)

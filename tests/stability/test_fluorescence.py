"""A surface that turns blue light into green: no reflectance explains it, and no spectrum is silently off."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core import pipeline
from dsl_core.devices.base import DeviceRig
from dsl_core.devices.registry import open_rig
from dsl_core.io.scan.folder import ScanReader
from dsl_core.model.presets import PRESETS
from dsl_core.model.result import Flag
from dsl_core.optics.colour_neighbours import bayer_colours
from dsl_core.simulation.scenes.truth import Scene
from dsl_core.simulation.sim_devices import SimCamera
from dsl_core.simulation.world import World

PATCH = "neutral 8 (.23 D)"
#: Light below 470 nm that comes back around 525 nm, as a share of what falls on the patch.
SHARE = 0.1


def make_fluorescent(rig: DeviceRig) -> None:
    """Let `PATCH` emit: for each colour of the mosaic, a reflectance that gives as many counts."""
    assert isinstance(rig.camera, SimCamera)
    assert rig.calibration is not None
    world, response = rig.camera.world, rig.calibration.response
    palette, scene_at = world.scene.materials, world.scene_at
    patch, nm = palette.names.index(PATCH), palette.wavelengths_nm
    seen = np.stack([np.interp(nm, curve.wavelengths_nm, curve.values) for curve in response])
    emission = np.exp(-0.5 * ((nm - 525.0) / 25.0) ** 2)
    counts = seen @ (emission / emission.sum())
    excited = SHARE / (1 + np.exp((nm - 470.0) / 6.0))

    def as_seen_by(colour: int) -> World:
        reflectance = palette.reflectance.copy()
        reflectance[patch] += excited * counts[colour] / np.maximum(seen[colour], 1e-3)

        def scene(position_mm: float) -> Scene:
            as_it_is = scene_at(position_mm)
            return replace(as_it_is, materials=replace(palette, reflectance=reflectance))

        return World(world.setup, scene, world.position_mm, world.request, world.seed)

    size = rig.camera.info
    colours = bayer_colours("RGGB", *np.mgrid[: size.height_px, : size.width_px])
    worlds = [as_seen_by(colour) for colour in range(3)]

    def rate() -> NDArray[np.float32]:
        for each in worlds:
            each.image = world.image
        return np.choose(colours, [World.rate(each) for each in worlds])

    world.rate = rate  # type: ignore[method-assign]


@pytest.mark.slow
def test_fluorescence_is_flagged_and_its_error_is_within_the_band(tmp_path: Path) -> None:
    plan = next(preset.plan for preset in PRESETS if preset.key == "coarse")
    with open_rig("twin", {"size": "112x72", "scene": "color-checker", "seed": "3"}) as rig:
        make_fluorescent(rig)
        with pipeline.open_scan(rig, pipeline.fit_plan(plan, rig), tmp_path / "s.dsl") as scan:
            scan.run()
        assert rig.calibration is not None
        result = pipeline.reconstruct(ScanReader(tmp_path / "s.dsl"), rig.calibration)
        world = rig.camera.world  # type: ignore[attr-defined]
    palette, material = world.scene.materials, world.truth.material
    patch = material == palette.names.index(PATCH)
    assert ((result["flags"].values[patch] & Flag.POOR_FIT) > 0).mean() > 0.95
    wanted = palette.at(result["wavelength_nm"].values)[palette.names.index(PATCH)][:, None]
    found, std = (result[name].values[:, patch] for name in ("reflectance", "reflectance_std"))
    assert np.nanmedian(found[:4] - wanted[:4]) > 0.04, "blue bands take up the light that came back green"
    assert (np.abs(found - wanted) <= 2 * std)[np.isfinite(found)].mean() > 0.9
    others = np.isin(material, palette.targets) & ~patch
    assert ((result["flags"].values[others] & Flag.POOR_FIT) > 0).mean() < 0.5
    green = slice(12, 40)
    assert np.nanmedian(np.abs(found - wanted)[green]) == pytest.approx(0, abs=0.01)

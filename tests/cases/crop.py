"""A small piece of the twin's image at full magnification, scanned quickly."""

from __future__ import annotations

from dsl_core.devices.base import DeviceRig
from dsl_core.model.rig import Rig
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.rendered_scene import Setup
from dsl_core.simulation.scenes.catalogue import make_scene
from dsl_core.simulation.sim_devices import assemble
from dsl_core.simulation.world import World


def cropped_rig(corner_px: tuple[int, int], size_px: tuple[int, int] = (64, 48)) -> Rig:
    """The published rig with a camera that reads out only a window; even corners keep the Bayer phase."""
    rig = published_rig()
    camera = rig.camera.model_copy(
        update={
            "cx_px": rig.camera.cx_px - corner_px[0],
            "cy_px": rig.camera.cy_px - corner_px[1],
            "width_px": size_px[0],
            "height_px": size_px[1],
        }
    )
    return rig.model_copy(update={"camera": camera})


def cropped_twin(scene: str, corner_px: tuple[int, int], size_px: tuple[int, int] = (64, 48)) -> DeviceRig:
    """The twin with all its effects, looking at a window of a scene."""
    setup = Setup(cropped_rig(corner_px, size_px))
    return assemble(World(setup, scene_at=lambda position_mm: make_scene(scene)))

"""All scenes by name: each brings the application into a state and takes pictures of it."""

from __future__ import annotations

from collections.abc import Callable

from tests.screens import (
    answers_scenes,
    calibrate_scenes,
    compare_scenes,
    results_scenes,
    rig_scenes,
    scan_scenes,
    shell_scenes,
    trouble_scenes,
    wizard_scenes,
)
from tests.screens.stage import Stage

Scene = Callable[[Stage], None]
SCENES: dict[str, Scene] = {
    **rig_scenes.SCENES,
    **calibrate_scenes.SCENES,
    **wizard_scenes.SCENES,
    **scan_scenes.SCENES,
    **results_scenes.SCENES,
    **answers_scenes.SCENES,
    **compare_scenes.SCENES,
    **shell_scenes.SCENES,
    **trouble_scenes.SCENES,
}

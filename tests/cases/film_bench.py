"""A bench with film on a drawn twin: what earlier calibrations found is true, the rest is unknown."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from dsl_core.campaign.common.recipe import AnyRecipe, Bench, Step
from dsl_core.devices.base import DeviceRig
from dsl_core.model.placement import Placement
from dsl_core.model.rig import Rig
from dsl_core.progress import NoProgress
from dsl_core.simulation.sim_devices import SimCamera, open_twin


def truth_of(devices: DeviceRig) -> Rig:
    """The rig that nobody knows."""
    assert isinstance(devices.camera, SimCamera)
    return devices.camera.world.rig


def film_bench(folder: Path, seed: int, known: Iterable[str], **options: str) -> Bench:
    """A small twin whose parts ``known`` are true and whose others are those of data sheets."""
    devices = open_twin({"truth": str(seed), "size": "112x72", **options})
    assert devices.nominal is not None
    parts = {name: getattr(truth_of(devices), name) for name in known}
    return Bench(devices, folder, devices.nominal.model_copy(update=parts))


def place(bench: Bench, placement: Placement) -> None:
    """Let the twin's hand place a target."""
    assert bench.devices.place is not None
    bench.devices.place(placement)


def take(recipe: AnyRecipe, bench: Bench, step: Step, **changed: object) -> None:
    """Place what a step asks for, changed where a test wants it, and capture it."""
    place(bench, step.placement.model_copy(update=changed))
    recipe.capture(bench, step, NoProgress())


def take_all(recipe: AnyRecipe, bench: Bench) -> Bench:
    """Capture every step; returns the bench."""
    for step in recipe.steps(bench):
        assert not recipe.is_captured(bench, step)
        take(recipe, bench, step)
        assert recipe.is_captured(bench, step)
    return bench


def without(bench: Bench, folder: Path, step: Step) -> Bench:
    """The captures but for one step, somewhere else."""
    for each in bench.folder.iterdir():
        if each.name != step.key:
            (folder / each.name).symlink_to(each)
    return Bench(bench.devices, folder, bench.rig)

"""The world keeps what has not changed, and its noise depends on nothing but the shot."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.rig import Rig
from dsl_core.simulation.bandpass_filters import true_transmission
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.rendered_scene import Setup
from dsl_core.simulation.scenes.catalogue import make_scene
from dsl_core.simulation.world import Kept, World

SIZE = (64, 42)


def small_rig(**projector: float) -> Rig:
    rig = published_rig()
    response = rig.projector_response.model_copy(update=projector)
    return rig.model_copy(update={"camera": rig.camera.resized(*SIZE), "projector_response": response})


def bands_of_columns(*bands: tuple[int, int], level: int = 255) -> NDArray[np.uint8]:
    image = np.zeros((360, 640, 3), np.uint8)
    for start, stop in bands:
        image[:, start:stop] = level
    return image


def test_a_kept_value_is_made_again_when_what_it_is_made_from_changes() -> None:
    lower: Kept[list[int]] = Kept()
    upper: Kept[list[int]] = Kept(lower)
    base, other = [1], [1]
    first = upper.of((base,), lambda: [1])
    under = lower.of((first,), lambda: [2])
    assert upper.of((base,), lambda: [3]) is first
    assert lower.of((first,), lambda: [4]) is under
    # An equal object is another one; what rests on the value is released before it is made again.
    again = upper.of((other,), lambda: [] if lower._held else [5])
    assert again == [5]
    assert lower.of((first,), lambda: [6]) == [6]


def test_only_what_changed_is_made_again() -> None:
    here = world()
    here.show(bands_of_columns((0, 640)))
    rate, bare, truth = here.rate(), here.renderer, here.truth
    assert here.rate() is rate
    here.show(bands_of_columns((0, 100)))
    assert here.rate() is not rate
    assert here.renderer is bare
    here.insert(True, true_transmission(540.0))
    assert here.renderer is not bare
    here.insert(True, None)
    assert here.renderer is bare
    here.insert(False, None)
    assert here.renderer is not bare
    assert here.truth is truth
    here.position_mm = 710.0
    assert here.truth is not truth


def world(seed: int = 0) -> World:
    rig = small_rig()
    return World(Setup(rig), scene_at=lambda mm: make_scene("plane", depth_mm=mm), seed=seed)


def test_noise_depends_only_on_seed_shot_and_attempt() -> None:
    one, other = world(), world()
    image = bands_of_columns((0, 640))
    one.show(image)
    first = one.expose(100.0, 7, 1)
    other.show(bands_of_columns())
    other.expose(50.0, 3)
    other.show(image)
    assert np.array_equal(other.expose(100.0, 7, 1), first)
    assert not np.array_equal(other.expose(100.0, 7, 2), first)
    assert not np.array_equal(other.expose(100.0, 8, 1), first)
    reseeded = world(seed=1)
    reseeded.show(image)
    assert not np.array_equal(reseeded.expose(100.0, 7, 1), first)


def test_a_pattern_changed_by_its_owner_does_not_change_what_is_shown() -> None:
    here = world()
    image = bands_of_columns((0, 640))
    here.show(image)
    image[:] = 0
    assert here.rate().max() > 1

"""The twin's scenes by name, each with known depth, normals, materials and shadow."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass

from dsl_core.errors import PlanError
from dsl_core.simulation.scenes import board as scene_board
from dsl_core.simulation.scenes import flat as scene_flat
from dsl_core.simulation.scenes import solid as scene_solid
from dsl_core.simulation.scenes.truth import Materials, Scene, SceneTruth

__all__ = ["Materials", "Scene", "SceneEntry", "SceneTruth", "make_scene", "scene_catalogue"]

Option = str | float | int

_BUILDERS: dict[str, Callable[..., Scene]] = {
    "plane": scene_flat.plane,
    "bowed": scene_flat.bowed,
    "stage": scene_flat.stage,
    "steps": scene_solid.steps,
    "sphere": scene_solid.sphere,
    "box": scene_solid.box,
    "wax": scene_solid.wax,
    "color-checker": scene_flat.color_checker,
    "board": scene_board.board,
    "filters": scene_flat.filters,
    "leaves": scene_flat.leaves,
    "relief": scene_solid.relief,
    "face": scene_solid.face,
}


@dataclass(frozen=True)
class SceneEntry:
    """A scene on offer: its name, what it shows, and its options with their defaults."""

    name: str
    description: str
    options: dict[str, Option]


def scene_catalogue() -> tuple[SceneEntry, ...]:
    """Every scene that `make_scene` can make."""
    return tuple(
        SceneEntry(name, (builder.__doc__ or "").split("\n")[0], _defaults(builder))
        for name, builder in _BUILDERS.items()
    )


def make_scene(name: str, **options: Option) -> Scene:
    """Build a scene by name; options may be text, as typed on a command line.

    Raises `PlanError` for an unknown name or option, or a value that is not a number or is out of range.

    >>> make_scene("plane", depth_mm="650").name
    'plane'
    """
    if name not in _BUILDERS:
        raise PlanError(f"There is no scene {name!r}; choose one of {', '.join(_BUILDERS)}.")
    builder = _BUILDERS[name]
    known = _defaults(builder)
    unknown = [key for key in options if key not in known]
    if unknown:
        raise PlanError(
            f"Scene {name!r} has no option {', '.join(unknown)}; its options are"
            f" {', '.join(f'{key}={value}' for key, value in known.items()) or 'none'}."
        )
    return builder(**{key: _convert(name, key, value, known[key]) for key, value in options.items()})


def _defaults(builder: Callable[..., Scene]) -> dict[str, Option]:
    return {key: parameter.default for key, parameter in inspect.signature(builder).parameters.items()}


def _convert(scene: str, key: str, value: Option, default: Option) -> Option:
    """The value as the type of the option's default."""
    try:
        return type(default)(value)
    except ValueError as error:
        kind = "a whole number" if isinstance(default, int) else "a number"
        raise PlanError(
            f"Option {key} of scene {scene!r} must be {kind} (default {default}), not {value!r}."
        ) from error

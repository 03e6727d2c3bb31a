"""What rendering only the effects that a scene calls for saves, and how far pictures are from all.

Random scenes of the twin before randomly drawn rigs: every picture with ``auto`` is compared, pixel by pixel
and without noise, with that of ``all``. Then, for each effect, a scene that needs it: leaving it out must
break the tolerance. Times are CPU seconds of frames with a line. Run:
``python -m tests.benchmarks.bench_effects``.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.model.plan import CapturePlan
from dsl_core.model.rig import Rig
from dsl_core.simulation.effects.base import LightPath, Limits, PatternView, make_view
from dsl_core.simulation.effects.catalogue import EFFECTS, NAMES, Choice, with_effects
from dsl_core.simulation.effects.planner import plan_effects
from dsl_core.simulation.effects.tolerance import Tolerance
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.random_rig import random_rig
from dsl_core.simulation.rendered_scene import EffectRequest, Setup
from dsl_core.simulation.world import World
from tests.benchmarks.common import options, print_table, write_json
from tests.cases.effect_scenes import CALLS_FOR, frame_dn, troubled_world, world_of

SCENES = 36
SIZE = (112, 73)
#: Frames with a line that are timed.
TIMED = 6


@dataclass(frozen=True)
class Compared:
    """Largest difference of pictures, its bound, what is left out, and CPU seconds of a frame with a line."""

    scene: str
    difference_dn: float
    bound_dn: float
    left_out: tuple[str, ...]
    auto_s: float
    all_s: float
    usual_s: float
    predicted_s: tuple[float, float]
    plan_s: float


def random_scene(rng: np.random.Generator) -> str:
    """A scene with options, as text."""

    def between(low: float, high: float) -> str:
        return f"{rng.uniform(low, high):.4g}"

    depth = between(620, 800)
    choices = (
        f"plane depth_mm={depth} tilt_x_deg={between(-30, 30)} tilt_y_deg={between(-30, 30)}",
        f"plane depth_mm={depth} reflectance={between(0.05, 0.99)}",
        f"bowed depth_mm={depth} bow_mm={between(0.1, 20)}",
        f"steps depth_mm={between(560, 640)} step_mm={between(1, 60)} count={rng.integers(1, 7)}",
        f"sphere depth_mm={depth} radius_mm={between(20, 80)}",
        # From a varnish that nobody sees to a mirror's.
        f"sphere gloss={10 ** rng.uniform(-9, -1):.3g} roughness={between(0.2, 0.8)}",
        f"box deep_mm={between(2, 180)} reflectance={between(0.1, 0.9)}",
        f"wax depth_mm={depth}",
        f"filters depth_mm={depth} fwhm_nm={between(5, 40)}",
        f"color-checker depth_mm={depth} tilt_y_deg={between(-30, 30)}",
        f"leaves depth_mm={depth}",
        f"board depth_mm={depth} tilt_x_deg={between(-30, 30)}",
        f"face depth_mm={between(600, 720)}",
        f"relief depth_mm={between(680, 760)}",
    )
    return str(choices[int(rng.integers(len(choices)))])


def random_pictures(rng: np.random.Generator) -> list[NDArray[np.uint8]]:
    """Drive levels up to 0.8: line, comb, code both ways, random columns, one LED, white, none."""
    line, comb, code, rows, dark = np.zeros((5, 360, 640), np.uint8)
    start = int(rng.integers(60, 560))
    line[:, start : start + 5] = 204
    comb[:, np.arange(640) % 106 < 5] = 204
    code[:, (np.arange(640) // 2 ** int(rng.integers(0, 7))) % 2 == 1] = 204
    rows[(np.arange(360) // 2 ** int(rng.integers(0, 7))) % 2 == 1] = 204
    columns = np.broadcast_to(rng.integers(0, 205, 640, np.uint8), (360, 640)).copy()
    colour = np.zeros((360, 640, 3), np.uint8)
    colour[:, start:, int(rng.integers(3))] = 204
    return [line, comb, code, rows, columns, colour, np.full_like(dark, 204), dark]


def largest_difference(
    paths: tuple[LightPath, ...], views: tuple[PatternView, ...], rng: np.random.Generator
) -> float:
    """The largest difference of any pixel between two paths, over pictures at the brighter setting, DN."""
    worst, exposure_ms = 0.0, Limits(paths[0]).demand.exposure_ms
    for image in random_pictures(rng):
        frames = [frame_dn(path, view, image, exposure_ms) for path, view in zip(paths, views, strict=True)]
        worst = max(worst, float(np.abs(frames[0] - frames[1]).max()))
    return worst


def seconds_of_a_line(view: PatternView) -> float:
    """CPU seconds of a frame with a line, the fastest of three runs."""
    lines = np.zeros((TIMED, 360, 640), np.uint8)
    for i, line in enumerate(lines):
        line[:, 40 + 560 * i // TIMED : 45 + 560 * i // TIMED] = 204
    view.expected(lines[0])
    runs = []
    for _ in range(3):
        started = time.process_time()
        for line in lines:
            view.expected(line)
        runs.append((time.process_time() - started) / TIMED)
    return min(runs)


def compare(scene: str, rig: Rig, tolerance: Tolerance, rng: np.random.Generator) -> Compared:
    """One world rendered with what it calls for, and with everything."""
    world = world_of(scene, rig, led_cycle_ms=None)
    everything = world.everything()
    started = time.process_time()
    plan = plan_effects(everything, tolerance)
    plan_s = time.process_time() - started
    chosen = with_effects(everything, plan.names)
    views = (make_view(everything), make_view(chosen))
    return Compared(
        scene,
        largest_difference((everything, chosen), views, rng),
        plan.left_out_bound,
        tuple(decision.effect.name for decision in plan.left_out),
        seconds_of_a_line(views[1]),
        seconds_of_a_line(views[0]),
        seconds_of_a_line(make_view(usual(world))),
        plan.seconds,
        plan_s,
    )


def usual(world: World) -> LightPath:
    """What the plain renderer has."""
    return World(Setup(world.rig), world.scene_at).path


def random_scenes(count: int, size: tuple[int, int], tolerance: Tolerance) -> list[Compared]:
    """Compare many random worlds; prints a line for each."""
    found = []
    for seed in range(count):
        rng = np.random.default_rng([seed, 5])
        base = published_rig()
        base = base.model_copy(update={"camera": base.camera.resized(*size)})
        rig = base if seed % 3 == 0 else random_rig(seed, base)
        found.append(compare(random_scene(rng), rig, tolerance, rng))
        print(
            f"{found[-1].scene[:58]:58s} {found[-1].difference_dn:8.4f} DN"
            f" {1e3 * found[-1].auto_s:6.1f} ms of {1e3 * found[-1].all_s:6.1f}",
            flush=True,
        )
    return found


def print_scenes(found: list[Compared], tolerance: Tolerance) -> None:
    """The table of all scenes, and the sums."""
    rows = [
        (
            one.scene[:58], f"{one.difference_dn:.4f}", f"{one.bound_dn:.3g}", f"{1e3 * one.auto_s:.1f}",
            f"{1e3 * one.all_s:.1f}", f"{100 * (1 - one.auto_s / one.all_s):.0f} %", len(one.left_out),
        )
        for one in found
    ]  # fmt: skip
    print_table(("scene", "differs by, DN", "bound", "auto, ms", "all, ms", "saved", "effects off"), rows)
    auto, everything, plain = (sum(getattr(one, f) for one in found) for f in ("auto_s", "all_s", "usual_s"))
    predicted = [sum(one.predicted_s[i] for one in found) for i in (0, 1)]
    off = sum(len(one.left_out) for one in found) / (len(found) * len(EFFECTS))
    worst = max(one.difference_dn for one in found)
    saved = 100 * (1 - auto / everything)
    print(
        f"{len(found)} scenes: largest difference {worst:.3g} DN (allowed {tolerance});"
        f" {100 * off:.0f} % of all effects are off;"
        f" a plan takes up to {max(one.plan_s for one in found):.2f} s"
    )
    print(
        f"A frame of each takes {auto:.2f} s instead of {everything:.2f} s: {saved:.0f} % saved; predicted"
        f" {predicted[0]:.2f} and {predicted[1]:.2f} s; the plain renderer takes {plain:.2f} s"
    )
    for effect in EFFECTS:
        share = np.mean([effect.name in one.left_out for one in found])
        print(f"  {effect.name:16s} off in {100 * share:3.0f} % of the scenes")


def needs(name: str, scene: str, tolerance: Tolerance) -> tuple[str, str, float, float, bool]:
    """How much a frame changes without an effect in a scene that calls for it, its bound, on or off."""
    troubled = name in ("vignetting", "defocus", "ambient", "led-cycle")
    worlds = [(troubled_world if troubled else world_of)(scene) for _ in range(2)]
    plan = plan_effects(worlds[0].everything(), tolerance)
    bound = next(d.bound.dn for d in plan.decisions if d.effect.name == name)
    worlds[0].request = EffectRequest(Choice.of("all"))
    worlds[1].request = EffectRequest(Choice(f"all but {name}", frozenset(NAMES) - {name}))
    return name, scene, change_of_frames(worlds), bound, name in plan.names


def change_of_frames(worlds: list[World]) -> float:
    """Largest difference of whole exposures, with noise of the same seed and rounding, DN."""
    dark, faint, bright = CapturePlan().settings[0], 51, 204
    lens, worst = worlds[0].rig.projector, 0.0
    line = np.zeros((lens.height_px, lens.width_px), np.uint8)
    line[:, lens.width_px // 2 : lens.width_px // 2 + 5] = bright
    for image in (line, *(np.full_like(line, level) for level in (0, faint, bright))):
        frames = []
        for world in worlds:
            world.show(image)
            frames.append(world.expose(dark.exposure_ms, 0).astype(float))
        worst = max(worst, float(np.abs(frames[0] - frames[1]).max()))
    return worst


def main() -> None:
    """Compare random scenes, then show the scenes that need each effect."""
    parser = options(__doc__)
    parser.add_argument("--tolerance", default="1DN", help="like 1DN or 0.5sigma")
    parser.add_argument("--size", default="x".join(map(str, SIZE)), help="camera pixels")
    chosen = parser.parse_args()
    torch.set_num_threads(1)
    tolerance = Tolerance.of(chosen.tolerance)
    width, height = map(int, chosen.size.split("x"))
    found = random_scenes(4 if chosen.quick else SCENES, (width, height), tolerance)
    print_scenes(found, tolerance)
    needed = [needs(name, scene, tolerance) for name, scene in CALLS_FOR.items()]
    print_table(
        ("effect", "scene that needs it", "changes by, DN", "bound", "on"),
        [(name, scene, f"{change:.3g}", f"{bound:.4g}", on) for name, scene, change, bound, on in needed],
    )
    write_json(
        chosen.json,
        {"scenes": [vars(one) for one in found], "needed": [list(row) for row in needed]},
    )


if __name__ == "__main__":
    main()

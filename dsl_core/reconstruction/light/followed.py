"""Frames as they would be in steady light: what a scan says of its light is taken off them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.fit import FitFinding
from dsl_core.model.plan import CapturePlan
from dsl_core.patterns.gray_code import DecodedCode
from dsl_core.progress import Progress
from dsl_core.reconstruction.hdr import MergedFrame, setting_gains_ms
from dsl_core.reconstruction.light.course import LightCourse, light_course
from dsl_core.reconstruction.light.heard import Witness
from dsl_core.reconstruction.light.line_levels import LineLevels, candidates, line_levels
from dsl_core.reconstruction.light.pictures import Pictures
from dsl_core.reconstruction.light.room_flicker import room_flicker
from dsl_core.reconstruction.light.setting_ratios import without_any, without_strange
from dsl_core.reconstruction.light.slow_black import slow_black
from dsl_core.reconstruction.light.steady import SteadyLight
from dsl_core.reconstruction.light.sudden import Again, sudden_changes
from dsl_core.reconstruction.light.told import black_wander, colour_findings, light_findings, sudden_findings
from dsl_core.reconstruction.light.witnesses import (
    LEVEL_ERROR,
    blacks_again,
    colours_of_whites,
    of_lines,
    of_settings,
    of_whites,
    without_steps,
)
from dsl_core.reconstruction.merge import Exposed, PickedLines

#: Frames whose sum is this far from white are of a scene that moved, or not what was asked for.
MOST_MISFIT = 0.2


class _Scan:
    """Code, white and chosen pixels of a scan, as its frames are exposed so far."""

    def __init__(
        self,
        frames: Pictures,
        code: DecodedCode,
        white: MergedFrame,
        also: Callable[[DecodedCode, MergedFrame], NDArray[np.intp]],
        progress: Progress | None,
    ) -> None:
        self.frames, self.code, self.white, self._also, self._progress = frames, code, white, also, progress
        self._believes_settings = True
        self._pixels = self._look()

    def _look(self) -> NDArray[np.intp]:
        pixels = candidates(self.code.column, (self.white.radiance, self.white.variance))
        self.frames.look(np.union1d(pixels, self._also(self.code, self.white)), self._progress)
        self._weigh_settings()
        return pixels

    def _weigh_settings(self) -> None:
        weigh = without_strange if self._believes_settings else without_any
        self.frames.ratios = weigh(self.frames.ratios)

    def disbelieve_settings(self) -> None:
        """From now on settings say nothing of the light against each other."""
        self._believes_settings = False
        self._weigh_settings()

    def expose(self, exposed: Exposed) -> None:
        """Read and decode all frames again, as exposed to other light."""
        self.frames.expose(exposed)
        self.code, self.white = self.frames.decode(self._progress)
        self._pixels = self._look()

    def lines(self) -> PickedLines:
        """The lines of the chosen pixels."""
        return self.frames.pick(self._pixels, self._progress)

    def _leak(self) -> tuple[NDArray[np.floating], bool]:
        """The projector's light in a black picture, as pictures of its setting are merged, DN per ms.

        Where it is not calibrated, as the second value says, it is all light in that picture.
        """
        rig, settings = self.frames.rig, self.frames.plan.settings
        gains_ms = setting_gains_ms(settings, rig.projector_response)
        longest = int(np.argmax(gains_ms))
        black = self.frames.source.read(self.frames.shots_of("black", 0)[longest])
        dark_dn = black.astype(np.float32) - rig.sensor.black_level_dn
        share = float(rig.projector_response.radiance(0.0))
        if share > 0:
            dark_dn = np.minimum(dark_dn, self.white.radiance * share * settings[longest].exposure_ms)
        return dark_dn / float(gains_ms[longest]), share > 0

    def levels(self) -> LineLevels | None:
        """How bright each line was; None where lines do not add up to white."""
        white = (self.white.radiance, self.white.variance)
        levels = line_levels(self.frames.plan, self.code.column, white, self.lines(), *self._leak())
        return None if levels is None or levels.misfit > MOST_MISFIT else levels


def follow_light(
    frames: Pictures,
    code: DecodedCode,
    white: MergedFrame,
    also: Callable[[DecodedCode, MergedFrame], NDArray[np.intp]],
    progress: Progress | None = None,
) -> tuple[DecodedCode, MergedFrame, tuple[FitFinding, ...]]:
    """Look at the frames of a scan, and have them follow the course of its light.

    Returns code and white in steady light, and what was found.

    Frames of several settings are read a second time if these had different light. ``also`` says which
    pixels will be asked for later, so that they are read at the same time.
    """
    scan = _Scan(frames, code, white, also, progress)
    whites = list(of_whites(frames))
    exposed, told = _follow_changes(scan, whites)
    whites = [without_steps(each, exposed) for each in whites]
    settings = [without_steps(each, exposed) for each in of_settings(frames)]
    shots, first_lines = frames.plan.shot_count, _first_lines(frames.plan)
    before = light_course([*settings, *whites], shots, first_lines)
    if before is not None and not before.is_steady:
        scan.expose(_between_settings(frames, before, exposed))
        settings = [without_steps(each, exposed) for each in of_settings(frames)]
    lines = scan.levels()
    course = light_course([*settings, *whites, *of_lines(frames, lines)], shots, first_lines)
    told = (*told, *colour_findings(list(colours_of_whites(frames))))
    if course is None:
        return scan.code, scan.white, told
    white = scan.white
    if not course.is_steady:
        light = _steady(frames, course, lines)
        frames.follow(light)
        white = light.steady_white(white)
    return scan.code, white, (*told, *light_findings(course, lines is not None))


def _follow_changes(scan: _Scan, whites: Sequence[Witness]) -> tuple[Exposed | None, tuple[FitFinding, ...]]:
    """Expose a scan to light that changes at once, to a black that does or drifts, and to a room's flicker.

    Returns what it is exposed to, None if as planned, and what was found.
    """
    frames, blacks = scan.frames, blacks_again(scan.frames)
    again = [Again(each.shot, each.log, each.std) for each in whites]
    sudden = sudden_changes(frames, scan.code.column, again, blacks)
    exposed = None if sudden is None else sudden.exposed(frames)
    slow = slow_black(frames, blacks, sudden)
    if slow is not None:
        exposed = slow.exposed(frames, exposed or Exposed.as_planned(frames.plan.shot_count))
    if exposed is not None:
        scan.expose(exposed)
    room = room_flicker(frames, scan.code.column, scan.lines(), exposed)
    if room is not None:
        exposed = room.exposed(exposed or Exposed.as_planned(frames.plan.shot_count))
        scan.expose(exposed)
    black = black_wander(blacks, sudden, 0.0 if room is None else room.rms_dn, slow)
    is_told = black is not None and black.significant
    if is_told and (sudden is None or not sudden.explains_black):
        # Dim settings show the change of black rather than that of the light.
        scan.disbelieve_settings()
    told = (black if is_told else None, None if room is None else room.finding)
    return exposed, (*(each for each in told if each is not None), *sudden_findings(sudden))


def _first_lines(plan: CapturePlan) -> list[int]:
    """The first shot of each setting that shows a pattern for spectra."""
    first: dict[int, int] = {}
    for shot in plan.shots():
        if shot.role == "spectral":
            first.setdefault(shot.setting, shot.index)
    return list(first.values())


def _between_settings(scan: Pictures, course: LightCourse, exposed: Exposed | None) -> Exposed:
    """What makes the shots of a pattern agree with that of its last setting, besides changes at once."""
    count = scan.plan.shot_count
    known = exposed or Exposed.as_planned(count)
    levels = known.levels.copy()
    for (role, pattern), ratios in scan.ratios.items():
        shots = scan.shots_of(role, pattern)
        for place, (shot, ratio) in enumerate(zip(shots[:-1], ratios, strict=False)):
            drift = course.log[shot.index] - course.log[shots[-1].index]
            apart = 0.0 if course.drifts or not course.settings else course.settings[place]
            seen = drift + apart
            if ratio is not None and course.flickers:
                steps = known.levels[shot.index] / known.levels[shots[-1].index]
                seen = ratio.log - float(np.log(steps))
            levels[shot.index] *= np.exp(seen)
    return replace(known, levels=levels)


def _steady(scan: Pictures, course: LightCourse, lines: LineLevels | None) -> SteadyLight:
    """What to take off the frames."""
    follows = lines is not None and course.flickers
    logs, stds = np.zeros((2, scan.plan.spectral_count))
    for pattern in range(len(logs)):
        shot = scan.shots_of("spectral", pattern)[-1].index
        log, std = course.log[shot], course.std[shot]
        if lines is not None and follows:
            slope = course.slope * (2 * (pattern + 0.5) / len(lines.log) - 1)
            own, std = lines.log[pattern] + course.white - slope, np.hypot(lines.std[pattern], LEVEL_ERROR)
            share = course.flicker**2 / (course.flicker**2 + std**2)
            log, std = log + share * (own - log), np.sqrt(share) * std
        logs[pattern], stds[pattern] = log, std
    level = course.white if follows else course.log[scan.shots_of("white", 0)[-1].index]
    return SteadyLight(logs, stds, float(level), follows)

"""Frames as they would be in steady light: what a scan says of its light is taken off them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.fit import FitFinding
from dsl_core.model.frames import FrameSource
from dsl_core.model.plan import CapturePlan, Role, Shot, spoken_number
from dsl_core.model.rig import ProjectorResponse, Rig
from dsl_core.optics.sensor import raw_variance
from dsl_core.patterns.gray_code import DecodedCode
from dsl_core.progress import Progress
from dsl_core.reconstruction.hdr import MergedFrame, setting_gains_ms
from dsl_core.reconstruction.light.course import (
    LEAST_DRIFT,
    LEAST_FLICKER,
    LightCourse,
    Witness,
    light_course,
)
from dsl_core.reconstruction.light.line_levels import LineLevels, candidates, line_levels
from dsl_core.reconstruction.light.room_flicker import room_flicker
from dsl_core.reconstruction.light.setting_ratios import Ratio, without_strange
from dsl_core.reconstruction.light.slow_black import SlowBlack, slow_black
from dsl_core.reconstruction.light.steady import SteadyLight
from dsl_core.reconstruction.light.sudden import (
    Again,
    SuddenChanges,
    share_of_black,
    sudden_changes,
)
from dsl_core.reconstruction.merge import Exposed, PickedLines

#: Frames whose sum is this far from white are of a scene that moved, or not what was asked for.
MOST_MISFIT = 0.2
#: What levels of frames may be wrong by beyond their own deviations: the sum of light is not exact.
LEVEL_ERROR = 0.004
#: Settings that differ by more are told, and what that is called.
LEAST_APART, APART = 0.01, "settings against each other"
#: What changes of black are called.
BLACK_AGAIN = "black taken again"
#: Share of white's values that those of first orders have, roughly.
FAINT = 0.1
#: Settings whose light (logarithm) is closer to each other say nothing of a camera's curve.
LEAST_BRACKET = 0.5
#: Changes of black that matter: first orders of dark surfaces are a few numbers bright.
MOST_BLACK_DN = 0.5
#: What a change of the light over a scan is called that frames are corrected for.
DRIFT = "drift of the light"
#: Rms of a flicker's changes of black that two pictures of it hardly exceed.
USUAL_FLICKERS = 3.0
_CORRECTED = " The frames are corrected for it."


class Pictures(Protocol):
    """The frames of a scan, as far as its light is concerned; see `dsl_core.reconstruction.rows.frames`."""

    source: FrameSource
    rig: Rig
    plan: CapturePlan
    ratios: dict[tuple[Role, int], tuple[Ratio | None, ...]]

    def shots_of(self, role: Role, pattern: int) -> list[Shot]:
        """The shots of a pattern, one for each setting it was captured with."""

    def expose(self, exposed: Exposed) -> None:
        """From now on merge frames as exposed to other light."""

    def follow(self, light: SteadyLight) -> None:
        """From now on give line frames as they would be in steady light."""

    def decode(self, progress: Progress | None = None) -> tuple[DecodedCode, MergedFrame]:
        """What the binary code says of every pixel, and white."""

    def look(self, pixels: NDArray[np.intp], progress: Progress | None = None) -> None:
        """Look at every frame once: compare settings, and keep the lines of some pixels for `pick`."""

    def pick(self, pixels: NDArray[np.intp], progress: Progress | None = None) -> PickedLines:
        """The lines of some pixels (flat indices)."""


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

    def look() -> NDArray[np.intp]:
        pixels = candidates(code.column, (white.radiance, white.variance))
        frames.look(np.union1d(pixels, also(code, white)), progress)
        frames.ratios = without_strange(frames.ratios)
        return pixels

    pixels = look()
    blacks, whites = blacks_again(frames), list(_of_whites(frames))
    sudden = sudden_changes(
        frames, code.column, [Again(each.shot, each.log, each.std) for each in whites], blacks
    )
    exposed = None if sudden is None else sudden.exposed(frames)
    slow = slow_black(frames, blacks, sudden)
    if slow is not None:
        exposed = slow.exposed(frames, exposed or Exposed.as_planned(frames.plan.shot_count))
    if exposed is not None:
        frames.expose(exposed)
        code, white = frames.decode(progress)
        pixels = look()
        whites = [_without(each, exposed) for each in whites]
    room = room_flicker(frames, code.column, frames.pick(pixels, progress), exposed)
    if room is not None:
        exposed = room.exposed(exposed or Exposed.as_planned(frames.plan.shot_count))
        frames.expose(exposed)
        code, white = frames.decode(progress)
        pixels = look()
    black = black_wander(blacks, sudden, 0.0 if room is None else room.rms_dn, slow)
    told = (
        *([] if black is None or not black.significant else [black]),
        *([] if room is None else [room.finding]),
        *_told_of_light(sudden),
    )
    if black is not None and black.significant and (sudden is None or not sudden.explains_black):
        # Dim settings show the change of black rather than that of the light.
        frames.ratios = {}
    settings = [_without(each, exposed) for each in _of_settings(frames)]
    shots, first_lines = frames.plan.shot_count, _first_lines(frames.plan)
    before = light_course([*settings, *whites], shots, first_lines)
    if before is not None and not before.is_steady:
        frames.expose(_between_settings(frames, before, exposed))
        code, white = frames.decode(progress)
        pixels = look()
        settings = [_without(each, exposed) for each in _of_settings(frames)]
    lines = line_levels(
        frames.plan, code.column, (white.radiance, white.variance), frames.pick(pixels, progress)
    )
    if lines is not None and lines.misfit > MOST_MISFIT:
        lines = None
    course = light_course([*settings, *whites, *_of_lines(frames, lines)], shots, first_lines)
    if course is None:
        return code, white, told
    if not course.is_steady:
        light = _steady(frames, course, lines)
        frames.follow(light)
        white = light.steady_white(white)
    return code, white, (*told, *light_findings(course, lines is not None))


def _first_lines(plan: CapturePlan) -> list[int]:
    """The first shot of each setting that shows a pattern for spectra."""
    first: dict[int, int] = {}
    for shot in plan.shots():
        if shot.role == "spectral":
            first.setdefault(shot.setting, shot.index)
    return list(first.values())


def blacks_again(scan: Pictures) -> list[Again]:
    """By how much black pictures that a scan took again differ from the first ones, DN."""
    plan, changes = scan.plan, []
    whites = {shot.setting: shot for shot in plan.shots() if shot.role == "white"}
    for shot in plan.shots():
        old = plan.original(shot)
        if shot.role == "sentinel" and old.role == "black":
            black = scan.source.read(old).astype(np.float32)
            more, share = scan.source.read(shot) - black, (0.0, float("inf"))
            if old.setting in whites:
                share = share_of_black(more, black, scan.source.read(whites[old.setting]))
            std = float(more.std()) / np.sqrt(more.size)
            changes.append(Again(shot.index, float(more.mean()), max(std, 1e-3), share))
    return changes


def black_wander(
    blacks: Sequence[Again],
    sudden: SuddenChanges | None = None,
    flicker_dn: float = 0.0,
    slow: SlowBlack | None = None,
) -> FitFinding | None:
    """What `blacks_again` says to a person, and since when; None without any.

    Of a black that flickers from frame to frame (``flicker_dn`` rms), changes by as much are no news.
    """
    if not blacks:
        return None
    means, stds = (np.array([getattr(each, name) for each in blacks]) for name in ("more", "std"))
    what = " All frames are off by as much."
    if sudden is not None and sudden.black:
        often = "at once" if sudden.explains_black else "in part at once"
        what = f" It did so {often}, {_since(sudden.black)}; the frames are corrected for that."
    if slow is not None:
        what = what if sudden is not None and sudden.black else ""
        what += (
            " The frames are corrected for a change that is even from one of these pictures to the next, and"
            f" taken to be off by {slow.std_dn:.1f} DN beyond that."
        )
    return FitFinding.judged(
        "light",
        BLACK_AGAIN,
        (float(np.sqrt(np.mean(means**2))), float(np.sqrt(np.mean(stds**2)))),
        "DN",
        max(MOST_BLACK_DN, USUAL_FLICKERS * flicker_dn),
        f"Black pictures changed by up to {means[np.abs(means).argmax()]:+.1f} DN during the scan: the black"
        f" level of the camera drifts, or the light of the room changes.{what}",
        "Let the camera warm up, switch on its black-level correction, and keep the light of the room away.",
    )


def _told_of_light(sudden: SuddenChanges | None) -> Iterator[FitFinding]:
    """What changes of light at once say to a person."""
    if sudden is None or not sudden.log:
        return
    worst = max(sudden.log.values(), key=abs)
    yield FitFinding.judged(
        "light",
        "step of the light",
        float(np.expm1(worst)),
        "1",
        LEAST_DRIFT,
        f"The light has changed by {np.expm1(worst):+.1%} at once, {_since(sudden.log)}.{_CORRECTED} Which of"
        " both was as calibrated, no scan can tell: the first is taken to be.",
        "Switch automatic exposure and gain of the camera off, and check the lamp and its supply.",
    )


def _since(steps: Iterable[int]) -> str:
    names = " and ".join(f"frame {spoken_number(at)}" for at in sorted(steps))
    return f"from {names} on"


def _without(witness: Witness, exposed: Exposed | None) -> Witness:
    """What a witness says of the light beyond its changes at once."""
    if exposed is None or witness.against is None:
        return witness
    known = np.log(exposed.levels[witness.shot] / exposed.levels[witness.against])
    return replace(witness, log=witness.log - float(known))


def light_findings(course: LightCourse, with_lines: bool) -> Iterator[FitFinding]:
    """What the course of the light says to a person."""
    change = float(np.expm1(course.drift))
    std = (1 + change) * course.drift_std
    drift = FitFinding.judged(
        "light",
        DRIFT,
        (change, std),
        "1",
        LEAST_DRIFT,
        (
            f"The light drifted by {change:+.1%} (±{std:.1%}) during the scan.{_CORRECTED}"
            if course.step_at is None
            else f"The light has changed by {change:+.1%} (±{std:.1%}) at once, from about frame"
            f" {spoken_number(course.step_at)} on.{_CORRECTED} Which of both was as calibrated, no scan can"
            " tell: the first is taken to be."
        ),
        (
            "Let the projector warm up for longer."
            if course.step_at is None
            else "Switch automatic exposure and gain of the camera off, and check the lamp and its supply."
        ),
    )
    yield drift.model_copy(update={"significant": course.drifts})
    if course.settings:
        yield _settings_finding(course)
    corrected = _CORRECTED if with_lines else " These patterns do not allow a correction."
    flicker = FitFinding.judged(
        "light",
        "flicker of the light",
        (course.flicker, course.flicker_std),
        "1",
        LEAST_FLICKER,
        f"The light flickered from frame to frame by {course.flicker:.1%} (rms).{corrected}",
        "Check the lamp and its supply, and expose for whole colour cycles of the projector.",
    )
    yield flicker.model_copy(update={"significant": course.flickers})


def unsure_level(plan: CapturePlan, response: ProjectorResponse, findings: Iterable[FitFinding]) -> float:
    """Relative deviation of the level of all light, where settings disagree about it or it has changed.

    Which of them is right no scan can tell, nor whose fault it is. A projector whose gamma is off by as much
    as makes settings of two drive levels disagree has, at the last of them, another share of its full light
    as well. A camera whose values follow a power of the light makes less of first orders, which are faint,
    than of white. The larger of both counts. What a change of the light is off by is common to all frames
    after it, and no average over frames makes it less.
    """
    findings = tuple(findings)
    change = next((f for f in findings if f.significant and f.name == DRIFT), None)
    return float(np.hypot(_unsure_settings(plan, response, findings), (change.std or 0.0) if change else 0.0))


def _unsure_settings(plan: CapturePlan, response: ProjectorResponse, findings: Sequence[FitFinding]) -> float:
    """The part of it of settings that disagree."""
    apart = next((f for f in findings if f.significant and f.name == APART), None)
    if apart is None:
        return 0.0
    log = float(np.log1p(apart.value))
    levels = [setting.level for setting in plan.settings]
    gains_ms = setting_gains_ms(plan.settings, response)
    projector = camera = 0.0
    if levels[-1] != levels[0]:
        projector = log / float(np.log(levels[-1] / levels[0])) * float(np.log(levels[-1]))
    apart_by = float(np.log(gains_ms[-1] / gains_ms[0]))
    if abs(apart_by) > LEAST_BRACKET:
        camera = log / apart_by * float(np.log(FAINT))
    return max(abs(projector), abs(camera))


def _settings_finding(course: LightCourse) -> FitFinding:
    worst = int(np.abs(course.settings).argmax())
    more = float(np.expm1(course.settings[worst]))
    drift = (
        " Or the light drifted between them."
        if course.drifts
        else (
            " The settings were made to agree; deviations of reflectance hold what the level may be off by."
        )
    )
    return FitFinding.judged(
        "response",
        APART,
        more,
        "1",
        LEAST_APART,
        f"Setting {worst + 1} is {abs(more):.1%} {'brighter' if more > 0 else 'darker'} than setting"
        f" {len(course.settings) + 1}, exposures and drive levels considered: the camera's values are not"
        f" proportional to the light, or exposures or levels are not as calibrated.{drift}",
        "Switch off gamma, automatic exposure and gain, store raw values, and repeat the self-test.",
    )


def _of_settings(scan: Pictures) -> Iterator[Witness]:
    sensor = scan.rig.sensor
    if sensor.rounds_light:
        return  # black is rounded too, and that is much of what a faint setting shows
    for (role, pattern), ratios in sorted(scan.ratios.items()):
        shots = scan.shots_of(role, pattern)
        for place, (shot, ratio) in enumerate(zip(shots[:-1], ratios, strict=False)):
            if ratio is not None:
                yield Witness(shot.index, shots[-1].index, ratio.log, ratio.std, setting=place)


def _of_whites(scan: Pictures) -> Iterator[Witness]:
    """White taken again, over white as it was taken first, each less the black next to it."""
    plan = scan.plan
    again = {shot: plan.original(shot) for shot in plan.shots() if shot.role == "sentinel"}
    blacks = [shot for shot, old in again.items() if old.role == "black"]
    for shot, old in again.items():
        near = [black for black in blacks if abs(black.index - shot.index) < 4]
        if old.role != "white" or not near:
            continue
        black = scan.shots_of("black", 0)[old.setting]
        first = scan.source.read(old).astype(np.float32) - scan.source.read(black)
        now = scan.source.read(shot).astype(np.float32) - scan.source.read(near[0])
        yield _compared(scan, shot, old, first, now)


def _compared(
    scan: Pictures, shot: Shot, old: Shot, first: NDArray[np.floating], now: NDArray[np.floating]
) -> Witness:
    limit = 0.9 * scan.rig.sensor.full_scale_dn
    used = (first > 0.25 * np.percentile(first, 95)) & (first < limit) & (now < limit)
    sums = [max(float(each[used].sum(dtype=np.float64)), 1.0) for each in (now, first)]
    noise = [float(raw_variance(scan.rig.sensor, each[used]).sum(dtype=np.float64)) for each in (now, first)]
    std = np.sqrt(noise[0] / sums[0] ** 2 + noise[1] / sums[1] ** 2)
    return Witness(shot.index, old.index, float(np.log(sums[0] / sums[1])), float(std))


def _of_lines(scan: Pictures, lines: LineLevels | None) -> Iterator[Witness]:
    if lines is None:
        return
    for pattern, (log, std) in enumerate(zip(lines.log, lines.std, strict=True)):
        shot = scan.shots_of("spectral", pattern)[-1]
        slope = 2 * (pattern + 0.5) / len(lines.log) - 1
        yield Witness(shot.index, None, float(log), float(np.hypot(std, LEVEL_ERROR)), slope)


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

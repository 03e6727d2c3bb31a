"""What the light of a scan says to a person, and how much less sure its reflectance is for that."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from dsl_core.model.conditions import COLOUR_NAMES
from dsl_core.model.fit import FitFinding
from dsl_core.model.plan import CapturePlan, spoken_number
from dsl_core.model.rig import ProjectorResponse
from dsl_core.reconstruction.hdr import setting_gains_ms
from dsl_core.reconstruction.light.course import LEAST_DRIFT, LEAST_FLICKER, LightCourse
from dsl_core.reconstruction.light.slow_black import SlowBlack
from dsl_core.reconstruction.light.sudden import Again, SuddenChanges
from dsl_core.reconstruction.light.witnesses import ColoursAgain

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
DRIFT, STEP = "drift of the light", "step of the light"
#: The calibrated light may be any from the first to the last of a scan: deviation of that, of the change.
ANY_BETWEEN = 1 / math.sqrt(3)
#: How far the light of a colour may be from that of all, as a share, in deviations, and what that is called.
LEAST_COLOUR, COLOUR_SIGMAS, COLOUR = 0.015, 6.0, "colour of the light"
#: Rms of a flicker's changes of black that two pictures of it hardly exceed.
USUAL_FLICKERS = 3.0
_CORRECTED = " The frames are corrected for it."
_FIRST = " Which light was as calibrated, no scan can tell: the first is taken to be."


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


def sudden_findings(sudden: SuddenChanges | None) -> Iterator[FitFinding]:
    """What changes of light at once say to a person."""
    if sudden is None or not sudden.log:
        return
    worst = max(sudden.log.values(), key=abs)
    unlike = f" (±{sudden.apart:.1%})" if sudden.apart else ""
    step = FitFinding.judged(
        "light",
        STEP,
        (float(np.expm1(worst)), sudden.apart),
        "1",
        LEAST_DRIFT,
        f"The light has changed by {np.expm1(worst):+.1%}{unlike} at once, {_since(sudden.log)}."
        f"{_CORRECTED}{_FIRST}",
        "Switch automatic exposure and gain of the camera off, and check the lamp and its supply.",
    )
    # That it came is sure; how high it is may not be.
    yield step.model_copy(update={"significant": True})


def _since(steps: Iterable[int]) -> str:
    names = " and ".join(f"frame {spoken_number(at)}" for at in sorted(steps))
    return f"from {names} on"


def colour_findings(colours: Sequence[ColoursAgain]) -> Iterator[FitFinding]:
    """What white taken again, the one whose colour differs most, says to a person."""
    told = [each for each in colours if each.apart > max(LEAST_COLOUR, COLOUR_SIGMAS * each.std)]
    if not told:
        return
    worst = max(told, key=lambda each: each.apart)
    more = ", ".join(
        f"{np.expm1(log):+.1%} in {name}" for name, log in zip(COLOUR_NAMES, worst.log, strict=True)
    )
    yield FitFinding.judged(
        "light",
        COLOUR,
        (worst.apart, worst.std),
        "1",
        LEAST_COLOUR,
        f"The light has changed its colour during the scan: white has {more}. Frames are corrected as if all"
        " colours had changed alike; deviations of reflectance hold what they differ by.",
        "Switch night mode, colour temperature and automatic white balance off, and check the lamps.",
    )


def colour_changed(found: Iterable[FitFinding]) -> float:
    """How far (log) a colour of the light has come from all light, as `colour_findings` tell; 0 if not."""
    return max((each.value for each in found if each.name == COLOUR and each.significant), default=0.0)


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
            f"The light drifted by {change:+.1%} (±{std:.1%}) during the scan.{_CORRECTED}{_FIRST}"
            if course.step_at is None
            else f"The light has changed by {change:+.1%} (±{std:.1%}) at once, from about frame"
            f" {spoken_number(course.step_at)} on.{_CORRECTED}{_FIRST}"
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
    after it, and no average over frames makes it less; nor does any frame say which light was calibrated, the
    first or the last. Light that changes its colour is followed as if all colours had changed alike.
    """
    findings = tuple(findings)
    changes = [each for each in findings if each.significant and each.name in (DRIFT, STEP)]
    off = [part for each in changes for part in (each.std or 0.0, ANY_BETWEEN * each.value)]
    colours = [each.value for each in findings if each.significant and each.name == COLOUR]
    return float(np.linalg.norm([_unsure_settings(plan, response, findings), *off, *colours]))


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

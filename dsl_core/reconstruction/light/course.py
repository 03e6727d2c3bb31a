"""The course of the light over a scan: a slow drift, and what changes from shot to shot.

Three witnesses are heard: frames of patterns relative to white, the same pattern at several settings, and
white taken again. The drift is a smooth curve that starts at zero with the first shot, because the light is
taken to have been as calibrated when the scan began. Flicker is what is left, frame by frame.

Settings of a camera that is not linear differ as if the light had drifted between them. They are told apart
by what witnesses say of the time within one setting. Light that changes at once is no smooth curve: such a
step is fitted at every shot, and shots at which it may have come are off by as much as that leaves open.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.reconstruction.light.heard import Heard, Witness
from dsl_core.solve.normal import STD_OF_MEDIAN_SIZE

Floats = NDArray[np.float64]

#: What the terms of the drift may be before a scan is seen: linear and quadratic over the scan.
DRIFT_STD = (0.5, 0.3)
NO_DRIFT = 1e-6
#: The same of a change at once.
STEP_STD = 0.5
#: Witnesses needed to say anything; so many are enough of pictures taken again, which see the light itself.
FEWEST, FEWEST_AGAIN = 4, 2
#: What a single one may be wrong by, as nothing says how much the light flickers.
ALONE_STD = 0.005
#: What settings may differ by through the response of the rig, and levels of lines by over the picture.
SETTING_STD, SLOPE_STD = 0.01, 0.02
#: The same of settings that are not as calibrated; witnesses must be so much likelier then (chi-square).
APART_STD, LIKELIER = 0.5, 25.0
#: So many places of a step are fitted at once: what that takes stays in the cache of a core.
AT_ONCE = 32
#: Witnesses farther off than so many deviations weigh less.
HUBER = 2.5
#: Changes of light below these are left as they are.
LEAST_DRIFT, LEAST_FLICKER = 0.006, 0.008
#: Deviations that a change has to be from none: its place on the curve is chosen after the fact.
SIGMAS = 4.5


@dataclass(frozen=True)
class LightCourse:
    """The light over a scan of ``shots``: ``log`` (shots,) of its level as it drifts, and its deviation.

    ``white`` is the logarithm of the level of white as it was merged, ``slope`` that unknown of the
    witnesses, ``flicker`` the rms from shot to shot; both kinds of change are zero where they do not matter.
    ``step_at`` is the likeliest first shot after a change at once, None where the light drifts smoothly.
    ``settings`` are logarithms of the signals of each but the last setting over what its exposure and level
    say, relative to the last one, in steady light; empty unless they explain what is seen as well as a drift
    does, or better: then there is no drift.
    """

    log: Floats
    std: Floats
    white: float
    slope: float
    drift: float
    drift_std: float
    flicker: float
    flicker_std: float
    settings: tuple[float, ...] = ()
    step_at: int | None = None

    @property
    def drifts(self) -> bool:
        """Whether the light drifts, more than by chance and more than nobody minds; a step was likelier."""
        return self.step_at is not None or abs(self.drift) > max(LEAST_DRIFT, SIGMAS * self.drift_std)

    @property
    def flickers(self) -> bool:
        """The same of shot to shot."""
        return self.flicker > max(LEAST_FLICKER, SIGMAS * self.flicker_std)

    @property
    def is_steady(self) -> bool:
        """Whether there is nothing to follow."""
        return not (self.drifts or self.flickers or self.settings)


def light_course(
    witnesses: Sequence[Witness], shots: int, first_lines: Sequence[int] = ()
) -> LightCourse | None:
    """The course that fits all witnesses best; None with too few.

    A single picture taken again says how far the light has come, and not on which way. A drift that may be
    chance is left out: the curve is then zero, and other figures are those without it. ``first_lines`` are
    the first shots of a setting that show patterns for spectra.
    """
    again = [each for each in witnesses if each.against is not None and each.setting is None]
    if len(witnesses) < FEWEST and len(again) < FEWEST_AGAIN:
        return _alone(again[0], shots) if again else None
    heard, nothing = Heard.of(witnesses), (NO_DRIFT, NO_DRIFT)
    found, apart = _course(heard, shots, DRIFT_STD), _course(heard, shots, nothing, APART_STD)
    flicker = min(found.flicker, apart.flicker)
    drift_misfit = _misfit(heard, shots, flicker, DRIFT_STD, SETTING_STD)
    apart_misfit = _misfit(heard, shots, flicker, nothing, APART_STD)
    if not found.is_steady or found.settings or apart_misfit < drift_misfit - LIKELIER:
        stepped = _stepped(heard, shots, flicker, first_lines)
        if stepped is not None and abs(stepped.drift) > LEAST_DRIFT:
            return stepped
    if apart_misfit < drift_misfit - LIKELIER:
        return apart
    if not found.drifts:
        level = _course(heard, shots, nothing)
        return replace(level, settings=(), drift=found.drift, drift_std=found.drift_std)
    others = heard.some(heard.setting < 0)
    rests_on_settings = len(others) < FEWEST or not _course(others, shots, DRIFT_STD).drifts
    return replace(found, settings=apart.settings if rests_on_settings else ())


def _alone(again: Witness, shots: int) -> LightCourse | None:
    """The course where the light may have changed at once at any shot between the two, or little by little.

    None where it has not changed, but for flicker. With a step that is as likely at one shot as at another, a
    shot has on average what a steady drift gives.
    """
    first = again.against or 0
    passed = np.clip((np.arange(shots) - first) / max(again.shot - first, 1), 0, 1)
    std = float(np.hypot(again.std, ALONE_STD))
    of_step = abs(again.log) * np.sqrt(passed * (1 - passed))
    found = LightCourse(
        log=passed * again.log,
        std=np.hypot(of_step, passed * std),
        white=0.0,
        slope=0.0,
        drift=again.log,
        drift_std=std,
        flicker=0.0,
        flicker_std=std,
    )
    return found if found.drifts else None


def _stepped(heard: Heard, shots: int, flicker: float, first_lines: Sequence[int]) -> LightCourse | None:
    """The course of light that changed once, at once; None unless that fits much better than smooth courses.

    It is the mean over all shots at which the step may have come, by how likely each of them is. A smooth
    course takes a part of a step for ``flicker``. A camera that is not linear shows bright codes in another
    ratio of the settings than faint lines: a step where lines begin has to be seen by a picture taken again.
    """
    nothing = (NO_DRIFT, NO_DRIFT)
    told = np.union1d(heard.shot, heard.against[heard.against >= 0])
    places = told[1:]
    if places.size == 0:
        return None

    first = int(places[_misfits(heard, shots, flicker, nothing, SETTING_STD, places).argmin()])
    flicker = min(flicker, _course(heard, shots, nothing, step_at=first).flicker)
    smooth = min(
        _misfit(heard, shots, flicker, DRIFT_STD, SETTING_STD),
        _misfit(heard, shots, flicker, nothing, APART_STD),
    )
    misfits = _misfits(heard, shots, flicker, nothing, SETTING_STD, places)
    if float(misfits.min()) > smooth - LIKELIER:
        return None
    by_lines = _misfits(heard, shots, flicker, nothing, SETTING_STD, np.array(first_lines, np.intp))
    if not heard.of_lamp.any() and by_lines.min(initial=np.inf) < misfits.min() + LIKELIER:
        return None
    likely = np.flatnonzero(misfits < misfits.min() + LIKELIER)
    weight = np.exp(-0.5 * (misfits[likely] - misfits.min()))
    # A step between two shots that witnesses know of is as likely at each shot between them.
    found = [_course(heard, shots, nothing, step_at=int(at)) for at in places[likely]]
    weight /= weight.sum()
    ramps = np.array(
        [_reached(shots, before, at) for before, at in zip(told[likely], places[likely], strict=True)]
    )
    heights = np.array([each.drift for each in found])
    log = (weight[:, None] * heights[:, None] * ramps).sum(0)
    square = heights[:, None] ** 2 * ramps + np.array([each.std**2 for each in found])
    std = np.sqrt(np.maximum((weight[:, None] * square).sum(0) - log**2, 0.0))
    best = found[int(weight.argmax())]
    return _as_seen_again(replace(best, log=log, std=std), heard)


def _as_seen_again(found: LightCourse, heard: Heard) -> LightCourse:
    """A step as high as all witnesses and bright pictures taken again after it say on average, if any were.

    Settings tell its date, and its height less surely: a change of black, which comes with one of the
    camera's gain, is much of what faint ones show. The course may be off by half of what both are apart.
    """
    at = found.step_at or 0
    heights = heard.log[heard.of_lamp & (heard.against < at) & (at <= heard.shot)]
    if heights.size == 0 or found.drift == 0:
        return found
    height = (float(heights.mean()) + found.drift) / 2
    reached = found.log / found.drift
    apart = abs(height - found.drift)
    return replace(
        found,
        log=height * reached,
        std=np.hypot(found.std, apart * reached),
        drift=height,
        drift_std=float(np.hypot(found.drift_std, apart)),
    )


def _reached(shots: int, before: int, at: int) -> Floats:
    """How likely a step after the shot ``before``, at the latest with ``at``, has come by each shot."""
    return np.clip((np.arange(shots) - before) / (at - before), 0.0, 1.0)


def _misfit(
    heard: Heard, shots: int, flicker: float, drift_std: tuple[float, float], setting_std: float
) -> float:
    """How badly the likeliest course fits all witnesses and what is believed before (robust chi-square)."""
    believed = _believed(heard, drift_std, setting_std, with_step=False)
    return float(_chi_square(heard.design(shots, None), heard.log, _noise(heard, flicker), believed))


def _misfits(
    heard: Heard,
    shots: int,
    flicker: float,
    drift_std: tuple[float, float],
    setting_std: float,
    places: NDArray[np.intp],
) -> Floats:
    """The same of courses with a step, at each of some shots; several at a time, as there are hundreds."""
    smooth, noise = heard.design(shots, None), _noise(heard, flicker)
    believed, found = _believed(heard, drift_std, setting_std, with_step=True), [np.empty(0)]
    for start in range(0, len(places), AT_ONCE):
        steps = heard.step(places[start : start + AT_ONCE, None])
        of_each = np.broadcast_to(smooth, (len(steps), *smooth.shape))
        designs = np.concatenate([of_each, steps[..., None]], -1)
        found.append(_chi_square(designs, heard.log, noise, believed))
    return np.concatenate(found)


def _chi_square(designs: Floats, log: Floats, noise: Floats, believed: Floats) -> Floats:
    """What fits (..., witnesses, terms) leave of witnesses, robust, and of what is ``believed`` before."""
    values, _, left = _fitted(designs, log, noise, believed)
    away = np.abs(left) / np.sqrt(noise)
    of_witnesses = np.where(away < HUBER, away**2, HUBER * (2 * away - HUBER)).sum(-1)
    return np.asarray(of_witnesses + ((values / believed) ** 2).sum(-1))


def _course(
    heard: Heard,
    shots: int,
    drift_std: tuple[float, float],
    setting_std: float = SETTING_STD,
    step_at: int | None = None,
) -> LightCourse:
    """The likeliest course under what is believed before, with a step at a shot or without one."""
    flicker = 0.0
    for _ in range(6):
        values, covariance, left = _fit(heard, shots, flicker, drift_std, setting_std, step_at)
        flicker, flicker_std = _flicker(heard, left)
    time = np.linspace(0, 1, shots)
    terms = np.stack([time, time**2], 1)
    drift = [0, 1]
    if step_at is not None:
        terms, drift = np.column_stack([terms, np.arange(shots) >= step_at]), [0, 1, len(values) - 1]
    log = terms @ values[drift]
    std = np.sqrt(np.einsum("sp,pq,sq->s", terms, covariance[np.ix_(drift, drift)], terms))
    furthest = int(np.abs(log).argmax())
    return LightCourse(
        log=log,
        std=std,
        white=float(values[2]),
        slope=float(values[3]),
        drift=float(log[furthest]),
        drift_std=float(std[furthest]),
        flicker=flicker,
        flicker_std=flicker_std,
        settings=tuple(values[4:].tolist()) if step_at is None else (),
        step_at=step_at,
    )


def _fit(
    heard: Heard,
    shots: int,
    flicker: float,
    drift_std: tuple[float, float],
    setting_std: float,
    step_at: int | None = None,
) -> tuple[Floats, Floats, Floats]:
    """Terms of the drift, level of white, slope, settings; their covariance; what is left of each witness.

    The last of the terms is the step at ``step_at``, if there is one.
    """
    believed = _believed(heard, drift_std, setting_std, step_at is not None)
    return _fitted(heard.design(shots, step_at), heard.log, _noise(heard, flicker), believed)


def _fitted(designs: Floats, log: Floats, noise: Floats, believed: Floats) -> tuple[Floats, Floats, Floats]:
    """The terms of robust fits (..., witnesses, terms), their covariances, and what they leave."""
    transposed = np.swapaxes(designs, -1, -2)
    prior = np.diag(believed**-2)
    weight = 1 / noise
    for _ in range(4):
        covariance = np.linalg.inv((transposed * weight[..., None, :]) @ designs + prior)
        values = covariance @ (transposed @ (weight * log)[..., None])
        left = log - (designs @ values)[..., 0]
        away = np.abs(left) / np.sqrt(noise)
        weight = np.minimum(1, HUBER / np.maximum(away, 1e-9)) / noise
    return np.asarray(values[..., 0]), np.asarray(covariance), np.asarray(left)


def _noise(heard: Heard, flicker: float) -> Floats:
    """Variance of what each witness says, of which those of two shots flicker twice."""
    return heard.own_variance + heard.flickering * flicker**2


def _believed(heard: Heard, drift_std: tuple[float, float], setting_std: float, with_step: bool) -> Floats:
    """Deviations of what is fitted before anything is seen."""
    return np.array([*drift_std, 1.0, SLOPE_STD, *[setting_std] * heard.settings, *[STEP_STD] * with_step])


def _flicker(heard: Heard, left: Floats) -> tuple[float, float]:
    """The rms of single shots, from the scatter of witnesses beyond their own deviations."""
    many, own = heard.flickering, heard.own_variance
    square = (left**2 * STD_OF_MEDIAN_SIZE**2 - own) / many
    # The median of squares stands for their mean, so that a few outliers do not make flicker.
    found = float(np.median(square))
    scatter = float(np.median((left**2 + own) / many)) * np.sqrt(2 / len(left)) * 2
    value = float(np.sqrt(max(found, 0.0)))
    return value, float(scatter / (2 * value)) if value > 0 else float(np.sqrt(scatter))

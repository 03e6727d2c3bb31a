"""The wave that a line spread which is off leaves in columns, as the binary code sees it.

Lines that lie side by side add up to the same light at every place, however wide they are: nothing in them
says how wide. A spread that is off displaces columns to or from the middles of lines. The code has fewer
places, but they do not depend on the lines: at each of its boundaries, pixels tell by how much columns are
displaced there. A width that explains this is the scan's own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.figure import with_std
from dsl_core.model.fit import FitFinding, matters
from dsl_core.model.rig import Rig
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.reconstruction.code_agreement import displacement, rms_beyond_chance
from dsl_core.reconstruction.columns.maps import ColumnMaps
from dsl_core.reconstruction.columns.spread_doubt import SpreadDoubt

Floats = NDArray[np.float64]

#: Columns that noise moves farther than this (px) gather at the middles of lines, which looks like a wave.
MOST_NOISE_PX = 0.1
#: Of the pixels beside a boundary of the code, this share has to have less noise: which do depends on where
#: noise moved them, so that a few of them are off on the average.
LEAST_KNOWN = 0.45
#: How well a boundary must be known (px): less well, noise is taken for a wave.
TELLING_PX = 0.04
#: A wave (rms, px) that matters.
MOST_WAVE_PX = 0.04
#: A difference from the calibrated width that is followed.
MOST_WIDER = 0.03
#: Share of the squares of a wave that a width has to explain to be followed, whatever it leaves.
EXPLAINS = 0.4
#: Parts of the picture, down and across, whose widths are compared.
PARTS = (3, 3)


@dataclass(frozen=True)
class OwnWidth:
    """By how much of the calibrated width lines are wider than that, and the deviation of it.

    ``noise`` is the part of the deviation that is chance, ``explains`` the share of the wave's squares that
    goes with the width.
    """

    wider: float
    std: float
    noise: float
    explains: float

    @property
    def changed(self) -> bool:
        """Whether that matters, and is more than chance."""
        return matters(self.wider, self._telling_std, MOST_WIDER)

    @property
    def _telling_std(self) -> float:
        """The deviation that says whether to follow: a width that takes much of a wave away is better."""
        return self.noise if self.explains > EXPLAINS else self.std

    def of(self, rig: Rig) -> Rig:
        """The rig with lines of this width."""
        response = rig.projector_response
        own = response.of_width((1 + self.wider) * response.blur_px)
        return rig.model_copy(update={"projector_response": own})

    def known(self, doubt: SpreadDoubt) -> SpreadDoubt:
        """What is left of a doubt about the width; what is not followed is doubted as well."""
        left = math.hypot(self.std, 0.0 if self.changed else self.wider)
        return replace(doubt, relative=min(left, doubt.relative))

    def finding(self) -> FitFinding:
        """What is told of it."""
        return FitFinding.judged(
            "profile",
            "width of lines by the binary code",
            (100 * self.wider, 100 * self._telling_std),
            "% of the width",
            100 * MOST_WIDER,
            f"The light of lines is {with_std(100 * abs(self.wider), 100 * self.std, 0)} %"
            f" {'wider' if self.wider > 0 else 'narrower'} than calibrated, as the binary code shows between"
            " them. The result follows it.",
            "If a flat matt target shows it, too, focus the projector as for its calibration, or calibrate"
            " again.",
        )


@dataclass(frozen=True)
class CodeWave:
    """By how much columns are displaced away from the middles of lines, px, with deviations.

    Each value is of one boundary of the code, ``off_px`` to the right of a middle, and its mirror image on
    the left.
    """

    off_px: Floats
    away_px: Floats
    std_px: Floats

    @property
    def rms_px(self) -> float:
        """Root mean square of the wave, less what chance explains."""
        return rms_beyond_chance(self.away_px, self.std_px)[0]

    @property
    def rms_std_px(self) -> float:
        """Deviation of the root mean square."""
        return rms_beyond_chance(self.away_px, self.std_px)[1]

    @property
    def error_px(self) -> float:
        """What columns are off by, rms; 0 where that is little or chance explains it."""
        return self.rms_px if matters(self.rms_px, self.rms_std_px, MOST_WAVE_PX) else 0.0

    def beyond(self, whole: CodeWave) -> CodeWave:
        """The wave of a part less that of the whole, at the boundaries that both know."""
        # What another shape of lines does is in both.
        own, of_whole = (np.isin(a.off_px, b.off_px) for a, b in ((self, whole), (whole, self)))
        return CodeWave(self.off_px[own], self.away_px[own] - whole.away_px[of_whole], self.std_px[own])

    def own_width(self, doubt: SpreadDoubt) -> OwnWidth:
        """The width that explains the wave best, with what was known of it."""
        moved = (doubt.moved_at(self.off_px) - doubt.moved_at(-self.off_px)) / 2
        weight = self.std_px**-2
        seen, prior = float(weight @ moved**2), doubt.relative**-2
        # A wider spread would take back what columns are displaced by.
        wider = -float(weight @ (moved * self.away_px)) / (seen + prior)
        # A wave of another shape than a width makes says less of it.
        square = float(weight @ (self.away_px + wider * moved) ** 2)
        left = square / max(len(moved) - 1, 1)
        std = (seen / max(left, 1.0) + prior) ** -0.5
        explains = 1 - square / max(float(weight @ self.away_px**2), 1e-12)
        return OwnWidth(wider, std, (seen + prior) ** -0.5, explains)

    def finding(self) -> FitFinding:
        """What is told of it."""
        most_px = float(np.abs(self.away_px).max())
        return FitFinding.judged(
            "profile",
            "columns between lines against the binary code",
            (self.rms_px, self.rms_std_px),
            "px",
            MOST_WAVE_PX,
            f"Between the middles of lines, columns lie up to {most_px:.2f} px from where the binary code saw"
            " them: lines have another shape or width than calibrated, or light is not counted evenly."
            " Deviations of depth contain it.",
            "Repeat the self-test with the projector in focus. A plan whose lines overlap, like balanced,"
            " shows the shape of lines itself.",
        )


def code_wave(lines: LineSet | None, named_px: NDArray[np.integer], maps: ColumnMaps) -> CodeWave | None:
    """The wave of the columns in ``maps`` that lines refined.

    ``named_px``, of a shape with as many pixels, are the columns that a code names, negative where it names
    none. None for lines that overlap, which show their spread themselves, and for too few pixels.
    """
    if lines is None or not lines.single or lines.step_px < lines.width_px:
        return None
    named_px = named_px.ravel()
    known = maps.refined & ~maps.unusual & (named_px >= 0) & (maps.column_std_px < MOST_NOISE_PX)
    exact = maps.column_px[known].astype(np.float64)
    # Each place between two middles of the projector's pixels has one boundary of the code.
    place = np.floor(exact).astype(np.int64) % lines.step_px
    shift, std = displacement(named_px[known], exact, place, lines.step_px)
    std[_known_share(named_px, known, lines.step_px) < LEAST_KNOWN] = np.inf
    left, right = _mirrored(lines)
    off = np.asarray((right + 0.5 - lines.first_px) % lines.step_px, np.float64)
    # What has moved displaces both sides alike, and cancels.
    away, away_std = (shift[left] - shift[right]) / 2, np.hypot(std[left], std[right]) / 2
    with np.errstate(invalid="ignore"):
        telling = np.maximum(std[left], std[right]) < TELLING_PX
    return CodeWave(off[telling], away[telling], away_std[telling]) if telling.any() else None


def _known_share(named_px: NDArray[np.integer], known: NDArray[np.bool_], step_px: int) -> Floats:
    """By place, the share of the pixels beside its boundary of the code whose columns are ``known``."""
    named = named_px >= 0
    own = named_px[named] % step_px
    total, sure = (
        np.bincount(own, weight, step_px) for weight in (np.ones(own.size), known[named].astype(np.float64))
    )
    beside, sure_beside = (each + np.roll(each, -1) for each in (total, sure))
    return np.asarray(sure_beside / np.maximum(beside, 1))


def with_varying_width(
    doubt: SpreadDoubt,
    lines: LineSet | None,
    named_px: NDArray[np.integer],
    maps: ColumnMaps,
    colours: NDArray[np.integer],
) -> SpreadDoubt:
    """A doubt that holds by how much widths in parts of the picture, and of its colours, differ.

    One width for all is off in most places of a lens that blurs its corners, and in a colour that it blurs
    more; waves of opposite signs cancel in the whole picture. ``colours``, of as many pixels, are those that
    pixels measure. Other arguments are those of `code_wave`. The same doubt where little differs.
    """
    whole = code_wave(lines, named_px, maps)
    if whole is None:
        return doubt
    row, column = (np.arange(size) * parts // size for size, parts in zip(named_px.shape, PARTS, strict=True))
    by_place, by_colour = (
        _off_by_kind(kind, whole, doubt, lines, named_px.ravel(), maps)
        for kind in ((row[:, None] * PARTS[1] + column).ravel(), colours.ravel())
    )
    if by_place is None and by_colour is None:
        return doubt
    squares = np.zeros(named_px.size)
    if by_place is not None:
        # A place that says less than all together is as far off as usual: widths differ inside of it, too.
        squares += np.maximum(by_place**2, np.mean(by_place**2))
    if by_colour is not None:
        squares += by_colour**2
    return replace(doubt, varies=np.sqrt(squares))


def _off_by_kind(
    kind: NDArray[np.integer],
    whole: CodeWave,
    doubt: SpreadDoubt,
    lines: LineSet | None,
    named_px: NDArray[np.integer],
    maps: ColumnMaps,
) -> Floats | None:
    """What the width of each pixel is off by, (pixels,), relative to the one for all, by its ``kind``.

    Kinds that do not tell are as far off as others. None where all of this is little, or chance.
    """
    waves = [
        code_wave(lines, named_px[kind == each], maps.of(kind == each)) for each in range(kind.max() + 1)
    ]
    free = replace(doubt, relative=1.0)
    own = {n: wave.beyond(whole).own_width(free) for n, wave in enumerate(waves) if wave is not None}
    if len(own) < 2:
        return None
    off, std = np.array([(width.wider, width.noise) for width in own.values()]).T
    varies, varies_std = rms_beyond_chance(off, std)
    if not matters(varies, varies_std, MOST_WIDER):
        return None
    of_kind = np.full(len(waves), varies)
    of_kind[list(own)] = off
    return np.asarray(of_kind[kind])


def _mirrored(lines: LineSet) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Places left and right of the middle of a line whose boundaries are equally far from it, (pairs,)."""
    place = np.arange(lines.step_px)
    right_px = (place + 0.5 - lines.first_px) % lines.step_px
    right = place[(right_px > 0) & (right_px < lines.step_px / 2)]
    return np.asarray((round(2 * lines.first_px) - 1 - right) % lines.step_px), right

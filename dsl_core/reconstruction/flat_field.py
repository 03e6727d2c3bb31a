"""How the camera's gain falls towards the corners, as a scan itself shows it.

Pixels a few apart that look alike mostly see one material: what their levels differ by, beyond shading, is
noise, or gain. A surface that is darker on one side, or a shading that is not quite right, does not look the
same from the middle to all four corners; the gain of a lens that falls with the square of the distance does.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.fit import FitFinding
from dsl_core.model.rig import FlatField, Rig
from dsl_core.optics.sensor import relative_gain
from dsl_core.solve.robust import robust_linear

Floats = NDArray[np.float64]
#: A change of the gain to the corner that matters; so many deviations of its own it must be away from zero,
#: and the quarters of the picture must agree about it to this share.
MOST_LOSS, SIGMAS, AGREED = 0.015, 6.0, 0.25
#: Error of the loss where a lens does not lose light with the square of the distance, relative to it.
FORM = 0.15
#: Pixels are compared that are this share of the width apart, an even number, so that colours are the same.
APART = 1 / 19
#: Steps of level and of smoothed shading (both relative) that are another material, or another surface.
ALIKE, EVEN = 0.06, 0.1
#: Pairs that are looked at in each direction, about; fewer in a quarter say nothing.
PAIRS, FEWEST = 30_000, 200
#: Nodes of a flat field, down and across.
NODES = (17, 25)


@dataclass(frozen=True)
class FlatFit:
    """Logarithm of the gain in the farthest corner, its deviation, and the same in quarters of the picture.

    ``beside_shading`` is what is left of it, with its deviation, where an error of the shading may take part.
    """

    corner: float
    corner_std: float
    quarters: tuple[float, ...]
    beside_shading: tuple[float, float]

    @property
    def present(self) -> bool:
        """Whether it matters, is not chance, and has the same size on all sides."""
        spread = float(np.std(self.quarters))
        also, also_std = self.beside_shading
        agreed = spread < AGREED * abs(self.corner) and abs(also - self.corner) < 2 * AGREED * abs(
            self.corner
        )
        sure = abs(self.corner) > SIGMAS * self.corner_std and abs(also) > 0.5 * SIGMAS * also_std
        return abs(self.corner) > MOST_LOSS and agreed and sure


def own_flat_field(rig: Rig, amplitude: NDArray[np.floating], shading: Floats) -> FlatFit | None:
    """The gain from zero-order levels and shading (rows, columns), NaN where unknown; None for too few."""
    pairs = _pairs(rig, amplitude, shading)
    whole = _slope(*pairs[:2])
    quarters = [_slope(*(values[pairs[3] == quarter] for values in pairs[:2])) for quarter in range(4)]
    beside = _slope(*pairs[:3])
    if whole is None or beside is None:
        return None
    known = [found[0] for found in quarters if found is not None]
    return None if len(known) < 4 else FlatFit(*whole, tuple(known), beside)


def with_flat_field(rig: Rig, found: FlatFit) -> Rig:
    """The rig with the gain that a scan shows, on top of its own."""
    height, width = rig.camera.height_px, rig.camera.width_px
    rows, columns = (np.linspace(0, size - 1, n) for size, n in zip((height, width), NODES, strict=True))
    gain = np.exp(found.corner * _square(rig, rows[:, None], columns[None]))
    known = np.broadcast_to(relative_gain(rig), (height, width))
    gain = gain * known[np.ix_(rows.round().astype(int), columns.round().astype(int))]
    field = FlatField(
        rows_px=tuple(rows.tolist()),
        columns_px=tuple(columns.tolist()),
        gain=tuple(tuple(row) for row in gain.tolist()),
    )
    return rig.model_copy(update={"flat_field": field})


def unsure_gain(rig: Rig, found: FlatFit) -> Floats:
    """Relative deviation of such a gain (rows, columns)."""
    rows, columns = np.arange(rig.camera.height_px)[:, None], np.arange(rig.camera.width_px)[None]
    unsure = float(np.hypot(found.corner_std, FORM * found.corner))
    return _square(rig, rows, columns) * unsure


def flat_finding(found: FlatFit) -> FitFinding:
    """What the scan says about the flat field."""
    change = float(np.expm1(found.corner))
    return FitFinding(
        part="flat field",
        name="gain in the corners",
        value=change,
        std=found.corner_std,
        unit="1",
        limit=MOST_LOSS,
        significant=found.present,
        sentence=(
            f"Surfaces of one colour change by {change:+.1%} from the middle to the farthest corner, alike on"
            " all sides: the gain of the camera, or how even the projector's light is, is not as calibrated."
            " Spectra of this result are corrected as for the camera."
        ),
        advice="Measure the flat field with a white sheet.",
    )


def _square(rig: Rig, rows: NDArray[np.generic], columns: NDArray[np.generic]) -> Floats:
    """Square of the distance from the camera's axis, one in the farthest corner."""
    lens = rig.camera
    away = [
        max(axis, size - 1 - axis)
        for axis, size in ((lens.cy_px, lens.height_px), (lens.cx_px, lens.width_px))
    ]
    square = np.subtract(rows, lens.cy_px) ** 2 + np.subtract(columns, lens.cx_px) ** 2
    return np.asarray(square / (away[0] ** 2 + away[1] ** 2), np.float64)


def _pairs(rig: Rig, amplitude: NDArray[np.floating], shading: Floats) -> tuple[Floats, ...]:
    """Steps of level, squared distance and shading between pixels that look alike, and their quarters."""
    height, width = amplitude.shape

    step = max(2, 2 * round(width * APART / 2))
    with np.errstate(invalid="ignore", divide="ignore"):
        levels, lights = np.log(amplitude / shading), np.log(shading)
    smooth = _smooth(lights, step)

    def seen(where: tuple[slice, slice]) -> tuple[Floats, NDArray[np.intp]]:
        rows, columns = np.meshgrid(np.arange(height)[where[0]], np.arange(width)[where[1]], indexing="ij")
        seen = [levels[where], _square(rig, rows, columns), smooth[where]]
        return np.stack(seen), np.stack([rows, columns])

    # Single pixels, evenly thinned: the stride keeps no colour out.
    stride = max(int((height * width / PAIRS) ** 0.5) | 1, 1)

    def steps() -> Iterator[Floats]:
        for down, across in ((0, step), (step, 0)):
            first = np.s_[: height - down : stride, : width - across : stride]
            second = np.s_[down::stride, across::stride]
            (here, (rows, columns)), (there, _) = seen(first), seen(second)
            found = there - here
            # By the shading of single pixels slopes would seem even where noise hides them, and from the
            # middle of a ball light falls to all sides.
            with np.errstate(invalid="ignore"):
                alike = (np.abs(found[0]) < ALIKE) & (np.abs(found[2]) < EVEN)
            quarter = 2 * (rows + down / 2 > height / 2) + (columns + across / 2 > width / 2)
            yield np.concatenate([found[:, alike], quarter[alike][None]])

    return tuple(np.concatenate(list(steps()), 1))


def _smooth(values: Floats, wide: int) -> Floats:
    """Values (rows, columns) averaged over what is about so many pixels around; NaN stays unknown.

    Noise of the shading is in levels, too, with the opposite sign: as a cause beside the gain it would seem
    to explain what it only shares with them.
    """
    from scipy.ndimage import gaussian_filter

    known = np.isfinite(values)
    light, weight = (
        gaussian_filter(each, wide / 2, mode="nearest", truncate=3.0)
        for each in (np.where(known, values, 0.0), known.astype(np.float64))
    )
    return np.where(known, light / np.maximum(weight, 1e-9), np.nan)


def _slope(level: Floats, *causes: Floats) -> tuple[float, float] | None:
    """By how much a level follows the first of its causes, and the deviation of that."""
    if len(level) < FEWEST:
        return None
    found, inverse, scatter = robust_linear(np.stack(causes, 1), level)
    return float(found[0]), float(scatter * inverse[0, 0] ** 0.5)

"""Whether light and film still are as calibrated, from white and a few lines on a plane.

The calibration predicts every signal of a plane of known reflectance. What is measured over what is predicted
says how far the light has changed; how far the first orders stand from where they should, whether the film
has moved.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.errors import CalibrationError
from dsl_core.model.conditions import colours_named
from dsl_core.model.figure import Figure
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import SpectralCurve, WavelengthGrid
from dsl_core.optics.correspondence import correspondence
from dsl_core.optics.pixel_model import PixelModel
from dsl_core.optics.spectra import ORDERS, SECOND_ORDERS, Bands
from dsl_core.solve.normal import MEDIAN_OVER_MEAN_STD
from dsl_core.solve.robust import robust_std

Floats = NDArray[np.float64]

LIGHT_LIMIT, FILM_LIMIT_PX, EFFICIENCY_LIMIT = 0.03, 0.2, 0.05
#: Bands of the prediction, without those that the model adds beyond both ends.
GRID = WavelengthGrid(start_nm=430.0, stop_nm=675.0, step_nm=5.0)
#: First orders may be displaced by this much for the slopes of the prediction, projector px.
_SLOPE_PX = 0.5
_MIN_SIGNALS = 200
#: Deviations from which a signal pulls no harder.
_HUBER = 1.345
_EVERY = (0, *ORDERS, *SECOND_ORDERS)


def white_signal(colour: str) -> str:
    """Name of the figure of a colour, or of a monochrome camera's light, which has no name.

    >>> white_signal("red"), white_signal("")
    ('white signal, red, over calibration', 'white signal, over calibration')
    """
    return ", ".join(part for part in ("white signal", colour, "over calibration") if part)


@dataclass(frozen=True)
class PlaneSignals:
    """Frames of a plane at some pixels.

    ``pixels`` are flat indices (P,), ``colours`` their mosaic colour 0..2, ``depth_mm`` and ``shading`` those
    of the plane; ``profiles`` (frames, width) 0..1 are what was shown, alike in all LEDs; ``radiance`` and
    its deviation ``std`` (infinite: unusable) are (frames, P), DN per ms.
    """

    pixels: NDArray[np.int64]
    colours: NDArray[np.int64]
    depth_mm: Floats
    shading: Floats
    profiles: Floats
    radiance: Floats
    std: Floats


def light_drift(rig: Rig, white: PlaneSignals, reflectance: SpectralCurve) -> list[Figure]:
    """Measured over predicted white signal of each colour that is seen, for a target of known reflectance."""
    expected = _Plane(rig, white, reflectance).signals()[0]
    usable = np.isfinite(white.std[0]) & (expected > 0.2 * np.median(expected))
    figures = []
    for colour, name in colours_named(rig.sensor.bayer).items():
        mine = usable & (white.colours == colour)
        if mine.sum() < _MIN_SIGNALS // 4:
            raise CalibrationError(
                f"Only {f'{mine.sum()} {name}'.strip()} pixels of the target are lit and not saturated."
                " Fill the middle of the picture with the target."
            )
        ratio = white.radiance[0, mine] / expected[mine]
        spread = float(robust_std(ratio - np.median(ratio)))
        figures.append(
            Figure(
                name=white_signal(name),
                value=float(np.median(ratio)),
                std=float(
                    np.hypot(MEDIAN_OVER_MEAN_STD * spread / np.sqrt(mine.sum()), rig.white_scale_rel_std)
                ),
                unit="1",
                low=1 - LIGHT_LIMIT,
                high=1 + LIGHT_LIMIT,
                advice="Light or exposure has changed, or the target is not the white that it was calibrated"
                " with: let the projector warm up and clean the target; otherwise repeat the spectralon"
                " calibration.",
            )
        )
    return figures


def film_drift(rig: Rig, lines: PlaneSignals, reflectance: SpectralCurve) -> list[Figure]:
    """Displacement of each first order (px) and its brightness over the zero order, against the calibration.

    The level of ``reflectance`` does not count: the brightness is divided by that of the zero order.
    """
    plane = _Plane(rig, lines, reflectance)
    zero = plane.signals((0,))
    every = np.isfinite(lines.std)
    brightness = _scale(lines, zero, every & (zero > 0.5 * zero.max(0)))
    figures: list[Figure] = []
    for order in ORDERS:
        here, ahead, behind = (plane.signals((order,), shift) for shift in (0.0, _SLOPE_PX, -_SLOPE_PX))
        slope = (ahead - behind) / (2 * _SLOPE_PX)
        # Only where this order is nearly all there is, so that errors of the zero order's halo do not count.
        other = plane.signals((0, -order))
        mine = every & (here > 0.02 * here.max()) & (other < 0.02 * here)
        if mine.sum() < _MIN_SIGNALS:
            raise CalibrationError(
                f"The first order {order:+d} lights only {int(mine.sum())} of the chosen pixels. Fill the"
                " middle of the picture with a flat target, film on."
            )
        data = (lines.radiance - other * brightness)[mine] / brightness
        shift, gain, shift_std, gain_std = _shift(data, here[mine], slope[mine], lines.std[mine] / brightness)
        figures += _film_figures(order, shift, shift_std, gain, gain_std)
    return figures


def _film_figures(
    order: int, shift: float, shift_std: float, gain: float, gain_std: float
) -> tuple[Figure, Figure]:
    return (
        Figure(
            name=f"displacement of order {order:+d}",
            value=shift,
            std=shift_std,
            unit="px",
            low=-FILM_LIMIT_PX,
            high=FILM_LIMIT_PX,
            advice="The film has moved: fix it and repeat the depth-stage calibration.",
        ),
        Figure(
            name=f"brightness of order {order:+d}, over calibration",
            value=gain,
            std=gain_std,
            unit="1",
            low=1 - EFFICIENCY_LIMIT,
            high=1 + EFFICIENCY_LIMIT,
            advice="The film is dirty or has been replaced: clean it, or repeat the bandpass calibration.",
        ),
    )


def _scale(lines: PlaneSignals, expected: Floats, usable: NDArray[np.bool_]) -> float:
    """Median of measured over expected signals."""
    if usable.sum() < _MIN_SIGNALS:
        raise CalibrationError(
            f"The lines light only {int(usable.sum())} of the chosen pixels directly. Fill the middle of the"
            " picture with a flat target."
        )
    return float(np.median(lines.radiance[usable] / expected[usable]))


def _shift(data: Floats, model: Floats, slope: Floats, std: Floats) -> tuple[float, float, float, float]:
    """Displacement (px) and gain by least squares, Huber weights, with standard deviations."""
    design = np.stack([slope, model], 1)
    # An error of the model in proportion to the signal keeps bright pixels from deciding alone.
    known = weight = 1 / (std**2 + (0.03 * model) ** 2)
    for _ in range(5):
        normal = design.T @ (weight[:, None] * design)
        answer = np.linalg.solve(normal, design.T @ (weight * data))
        off = data - design @ answer
        spread = robust_std(off * np.sqrt(known))
        sigmas = np.abs(off) * np.sqrt(known) / max(spread, 1e-12)
        weight = known * np.minimum(1, _HUBER / np.maximum(sigmas, _HUBER))
    # A little more light changes the pull of a signal within the limit only (Huber 1981, section 7.6).
    inverse = np.linalg.inv(design.T @ ((known * (sigmas < _HUBER))[:, None] * design))
    bread = design * (weight * off)[:, None]
    covariance = inverse @ (bread.T @ bread) @ inverse
    gain = float(answer[1])
    std_shift, std_gain = np.sqrt(np.diag(covariance))
    return float(answer[0] / gain), gain, float(std_shift / gain), float(std_gain)


class _Plane:
    """What the calibration expects of a plane of known reflectance under the patterns shown."""

    def __init__(self, rig: Rig, signals: PlaneSignals, reflectance: SpectralCurve) -> None:
        profiles = np.repeat(signals.profiles[:, :, None], 3, axis=2)
        self.model = PixelModel(rig, Bands.of(rig, GRID), profiles, correspondence(rig))
        place = torch.as_tensor(signals.pixels), torch.as_tensor(signals.depth_mm)
        self.traced = self.model.trace(*place, orders=_EVERY[1:])
        self.shading, self.colours, self.reflectance = signals.shading, signals.colours, reflectance

    def signals(self, orders: tuple[int, ...] = _EVERY, shift_px: float = 0.0) -> Floats:
        """Signals (frames, P) through some orders in each pixel's own colour, DN per ms.

        ``shift_px`` displaces all but the zero order.
        """
        shading = torch.as_tensor(self.shading)
        operator = self.model.operator(self.traced.displaced(shift_px), shading, orders=orders)
        bands = torch.as_tensor(self.reflectance.at(self.model.bands.centres_nm)).to(shading)
        target = bands[:, None].expand(-1, len(shading))
        every_colour = operator.forward(target).numpy()
        return np.asarray(every_colour[self.colours, :, np.arange(len(shading))].T)

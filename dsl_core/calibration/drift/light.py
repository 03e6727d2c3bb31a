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
#: Shares of an order's light that come from inside the projector's picture, at least, where its brightness
#: and its place say something of the film. Of less only the ends of its spectrum are seen, and an error of
#: the prediction there looks like a displacement. Unchanged films of 830 lines/mm have .79 and seem displaced
#: by .04 px, of 900 .69 and .1 px, of 1000 .45 and .44 px at the right brightness, of 1100 .24 at 1.4 times.
LEAST_FOR_BRIGHTNESS, LEAST_FOR_PLACE = 0.4, 0.6
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
                " calibration, and capture those after it again, which measure the light as well.",
            )
        )
    return figures


def film_drift(rig: Rig, lines: PlaneSignals, reflectance: SpectralCurve) -> list[Figure]:
    """Displacement of each first order (px) and its brightness over the zero order, against the calibration.

    A figure without limits says of an order that it cannot be judged, by too little light of its own.
    The level of ``reflectance`` does not count: the brightness is divided by that of the zero order.
    """
    plane = _Plane(rig, lines, reflectance)
    zero = plane.signals((0,))
    brightness = _scale(lines, zero, np.isfinite(lines.std) & (zero > 0.5 * zero.max(0)))
    return [figure for order in ORDERS for figure in _of_order(order, plane, lines, brightness)]


def _of_order(order: int, plane: _Plane, lines: PlaneSignals, brightness: float) -> tuple[Figure, ...]:
    """The figures of one first order; ``brightness`` is that of the zero order over the calibration."""
    here, ahead, behind = (plane.signals((order,), shift) for shift in (0.0, _SLOPE_PX, -_SLOPE_PX))
    slope = (ahead - behind) / (2 * _SLOPE_PX)
    # Only where this order is nearly all there is, so that errors of the zero order's halo do not count.
    other = plane.signals((0, -order))
    alone = (here > 0.02 * here.max()) & (other < 0.02 * here)
    share = float(np.broadcast_to(plane.inside(order), alone.shape)[alone].mean()) if alone.any() else 0.0
    unknown = _unjudged(order, int(alone.sum()), share)
    if alone.sum() < _MIN_SIGNALS or share < LEAST_FOR_BRIGHTNESS:
        return unknown
    mine = np.isfinite(lines.std) & alone
    if mine.sum() < _MIN_SIGNALS:
        raise CalibrationError(
            f"The first order {order:+d} lights only {int(mine.sum())} of the chosen pixels. Fill the"
            " middle of the picture with a flat target, film on."
        )
    data = (lines.radiance - other * brightness)[mine] / brightness
    shift, gain, shift_std, gain_std = _shift(data, here[mine], slope[mine], lines.std[mine] / brightness)
    found = _film_figures(order, shift, shift_std, gain, gain_std)
    return (*unknown, found[1]) if unknown else found


def _unjudged(order: int, signals: int, share: float) -> tuple[Figure, ...]:
    """A figure on why an order says too little of the film, none where it says enough.

    ``signals`` is how many it should have to itself, ``share`` how much of their light is from inside the
    picture.
    """
    advice = "Only the other order, or a scan of a known surface, can show whether such a film has changed."
    if signals < _MIN_SIGNALS:
        name = f"signals of order {order:+d} alone, too few to judge this film by it"
        return (Figure(name=name, value=float(signals), unit="", advice=advice),)
    if share >= LEAST_FOR_PLACE:
        return ()
    what = "judge this film by it" if share < LEAST_FOR_BRIGHTNESS else "tell whether it is displaced"
    name = f"light of order {order:+d} from inside the picture, too little to {what}"
    return (Figure(name=name, value=100 * share, unit="%", advice=advice),)


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

    def inside(self, order: int) -> Floats:
        """Share of an order's light that is from inside the picture, (P,), each pixel in its own colour."""
        bands = self.model.bands.moments[order].sum(1)[self.colours].T
        seen = self.model.inside(self.traced.orders[order], 0.0).numpy()
        return np.asarray((bands * seen).sum(0) / np.maximum(bands.sum(0), 1e-300))

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

"""In what a calibrated rig differs from the simple model that calibration starts from, in words with figures.

A calibration measures these and every result follows them, so that no scan finds anything wrong. They are
told once, as they say what kind of rig it is, and where to look if a later scan disagrees.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.model.calibration.selftest import OFF_CURVE, OFF_POWER_LAW
from dsl_core.model.fit import SIGMAS
from dsl_core.model.rig import Rig
from dsl_core.optics.correspondence import GratingModel, correspondence
from dsl_core.optics.spectra import ORDERS, SECOND_ORDERS

#: From which on a trait is told: light off a power law, second orders over first ones (a usual film has 4 %),
#: columns of the first orders off those of a film that is a cylinder (px, rms), red and blue apart at the
#: side of the projector's frame (px), and the range of the camera's gain over the picture.
LEAST_TONE, LEAST_SECOND, LEAST_FILM_PX, LEAST_COLOUR_PX, LEAST_GAIN = 0.01, 0.06, 0.1, 0.1, 0.03
#: Light off the form that was taken for it by so much (%, rms) is told.
LEAST_RAMP = 0.2
#: Wavelengths at which orders are compared.
_NM = np.linspace(450.0, 650.0, 5)
#: Places of the picture, down and across, and their distance from the border as a share.
_PLACES, _BORDER = (7, 11), 0.05
#: Wavelengths of red and blue light.
_APART_NM = 180.0


def measured_traits(rig: Rig) -> tuple[str, ...]:
    """Clauses on what a rig's calibration measured beyond the simple model; none if nothing was calibrated.

    >>> from dsl_core.simulation.published_rig import published_rig
    >>> measured_traits(published_rig())
    ()
    """
    return tuple(_traits(rig)) if rig.calibrations else ()


def traits_in_words(rig: Rig) -> str:
    """A sentence on `measured_traits`; empty without any."""
    found = measured_traits(rig)
    return f"Measured by the calibration, and followed: {'; '.join(found)}." if found else ""


def _traits(rig: Rig) -> Iterator[str]:
    tone = off_power_law(rig)
    if tone > LEAST_TONE:
        yield f"the projector's light is up to {tone:.1%} off a power law of the drive level"
    for figure in (figure for note in rig.calibrations for figure in note.figures):
        form = {OFF_POWER_LAW: "a power law", OFF_CURVE: "a smooth curve"}.get(figure.name)
        # Too little for a richer curve, which would follow the noise of the ramps.
        if form is not None and figure.value > max(LEAST_RAMP, SIGMAS * (figure.std or 0.0)):
            yield f"the projector's light is {figure.value:.2f} % (rms) off {form} of the drive level"
    second = second_order_share(rig)
    if second > LEAST_SECOND:
        yield f"second orders have {second:.1%} of the light of the first"
    off_px = np.abs(film_columns_px(rig))
    rms_px = float(np.sqrt(np.mean(off_px**2))) if off_px.size else 0.0
    if rms_px > LEAST_FILM_PX:
        yield (
            f"the film is bent beyond the form of a cylinder: its first orders lie {rms_px:.2f} columns (rms,"
            f" at most {off_px.max():.2f}) from where one would put them"
        )
    if rig.lateral_colour is not None:
        apart_px = abs(rig.lateral_colour.projector_per_nm) * _APART_NM * rig.projector.width_px / 2
        if apart_px > LEAST_COLOUR_PX:
            yield f"red and blue light lie {apart_px:.2f} columns apart at the side of the projector's frame"
    if rig.flat_field is not None:
        gain = np.array(rig.flat_field.gain)
        uneven = float(np.ptp(gain) / gain.max())
        if uneven > LEAST_GAIN:
            yield f"the gain of the camera differs by {uneven:.1%} over the picture"


def off_power_law(rig: Rig) -> float:
    """By how much the projector's light is at most off a power law, as a share, where it was measured."""
    response = rig.projector_response
    if response.tone is None:
        return 0.0
    level = np.linspace(response.tone.lowest_level, 1.0, 100)
    return float(np.abs(response.tone.light(level) / level**response.gamma - 1).max())


def second_order_share(rig: Rig) -> float:
    """Light of the second orders over that of the first."""
    first, second = (
        sum(float(rig.efficiency[order].at(_NM).mean()) for order in orders if order in rig.efficiency)
        for orders in (ORDERS, SECOND_ORDERS)
    )
    return second / first if first > 0 else 0.0


def film_columns_px(rig: Rig) -> NDArray[np.float64]:
    """Columns (px) of the first orders here and there, less those by the same film as a cylinder.

    At the middle of the calibrated depths; only where both land on the projector's frame.
    """
    if rig.residual is None and rig.film.shape is None:
        return np.empty(0)
    height, width = rig.camera.height_px, rig.camera.width_px
    row, column = (
        np.linspace(_BORDER * size, (1 - _BORDER) * (size - 1), count).astype(int)
        for size, count in zip((height, width), _PLACES, strict=True)
    )
    pixels = torch.as_tensor((row[:, None] * width + column).ravel())
    depth = torch.full((len(pixels),), float(np.mean(rig.depth_range_mm)), dtype=torch.float64)
    plain = rig.model_copy(update={"residual": None, "film": rig.film.model_copy(update={"shape": None})})
    own = correspondence(rig, "auto" if rig.residual is not None else "grating")
    columns = [
        np.stack([model.trace(pixels, depth, order, _NM).columns.numpy() for order in ORDERS])
        for model in (own, GratingModel(plain))
    ]
    inside = ((columns[1] >= 0) & (columns[1] < rig.projector.width_px)) & np.isfinite(columns[0])
    return np.asarray((columns[0] - columns[1])[inside], np.float64)

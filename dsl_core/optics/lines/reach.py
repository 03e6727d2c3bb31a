"""Which share of the bands the first orders of a rig reach: what film and projector make of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.geometry import Lens
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.pinhole import project, rays_at

Floats = NDArray[np.float64]
#: More of the bands of lit pixels without a first order than this is not what a film is chosen for: at the
#: side of a sound rig's picture a third may be.
MOST_UNREACHED = 0.5
#: About so many pixels are asked, at so many wavelengths.
MOST_PIXELS, BANDS = 200, 12
#: Share of the most that a first order sends of a wavelength from which one is said to send light.
LEAST_SENT = 0.01
#: First orders, and steps towards the place on the film where their light passes.
ORDERS, ITERATIONS = (1, -1), 5


def unreached_words(share: float) -> tuple[str, str]:
    """What is said of that share of the bands, and what to do."""
    return (
        f"No first order reaches {share:.0%} of the bands of lit pixels: the film sends their light beyond"
        " the projector's frame, or the film has no such order, and the prior decides about them.",
        "Use a film of fewer lines per mm or a projector with a wider field, or move the object to the middle"
        " of the projector's frame; then calibrate again if the rig has changed.",
    )


def sends_light(rig: Rig, order: int, wavelengths_nm: Floats) -> NDArray[np.bool_]:
    """Whether a film sends light of wavelengths (n,) through a first order, (n,): some have only one."""
    most = max((max(rig.efficiency[m].values) for m in ORDERS if m in rig.efficiency), default=0.0)
    if order not in rig.efficiency or most <= 0:
        return np.zeros(len(wavelengths_nm), bool)
    return np.asarray(rig.efficiency[order].at(wavelengths_nm) > LEAST_SENT * most)


def unreached_share(rig: Rig) -> float:
    """Share of the bands that no first order reaches, over pixels that the projector lights; NaN for none.

    At a surface that faces the camera at the rig's usual depth, through a flat film square to the projector,
    which is good to a few columns. The window asks at every change of a plan: without torch, at few pixels.
    """
    size = rig.camera.width_px * rig.camera.height_px
    rows, columns = np.divmod(np.arange(0, size, size // MOST_PIXELS | 1), rig.camera.width_px)
    rays = rays_at(rig.camera, columns.astype(float), rows.astype(float))
    points = rig.pose.matrix @ (rays * rig.usual_depth_mm) + rig.pose.vector_mm[:, None]
    points = points[:, _inside(rig.projector, points)]
    if not points.size:
        return float("nan")
    ends = WavelengthGrid()
    nm = np.linspace(ends.start_nm, ends.stop_nm, BANDS)
    reached = [
        _inside(rig.projector, _sent(rig, points, m * nm / rig.film.period_nm))
        & sends_light(rig, m, nm)[:, None]
        for m in ORDERS
    ]
    return float(1 - (reached[0] | reached[1]).mean())


def _sent(rig: Rig, points_mm: Floats, turned: Floats) -> Floats:
    """Directions (3, bands, n) in which light leaves for points (3, n), turned by sines (bands,)."""
    distance_mm, (x, y, z) = rig.film.distance_mm, points_mm[:, None]
    sent = points_mm[:, None] / z + np.zeros((1, len(turned), 1))
    for _ in range(ITERATIONS):
        at = distance_mm * sent[:2] / sent[2]
        left = np.stack([x - at[0], y - at[1], (z - distance_mm) + 0 * at[0]])
        across, along = left[:2] / np.linalg.norm(left, axis=0)
        across = across + turned[:, None]
        with np.errstate(invalid="ignore"):
            sent = np.stack([across, along, np.sqrt(1 - across**2 - along**2)])
    return np.asarray(sent)


def _inside(lens: Lens, directions: Floats) -> NDArray[np.bool_]:
    """Whether directions (3, ...) of light are inside a projector's frame."""
    column, row = project(lens, *directions)
    inside = (column > -0.5) & (column < lens.width_px - 0.5) & (row > -0.5) & (row < lens.height_px - 0.5)
    return np.asarray(inside)

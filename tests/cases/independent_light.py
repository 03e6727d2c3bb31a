"""A scan rendered from the physics alone, by nothing that the program reconstructs with.

Records of the calibration, and the pictures that a projector is told to show, are the program's. Everything
else is worked out here in another way: rays through both lenses by Newton's method, the place where light
leaves the film from the two conditions that the grating puts on its directions, lines as sharp discs out of
focus, light summed over a nanometre grid, spectra with edges and absorption lines.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from dsl_core.model.geometry import Lens, Pose
from dsl_core.model.plan import CapturePlan
from dsl_core.model.projector.line_spread import LineSpread
from dsl_core.model.rig import Film, ProjectorResponse, Rgb, Rig, Sensor
from dsl_core.model.spectral import SpectralCurve
from dsl_core.patterns.images import pattern_image
from tests.cases.twin_scan import MemoryScan

Floats = NDArray[np.float64]
NM = np.arange(395.0, 706.0)
#: Wavelengths at which rays are traced, between which their columns are polynomials.
NODES_NM = 550 + 155 * np.cos(np.pi * (np.arange(8) + 0.5) / 8)
#: Samples of a column on which first orders are collected, and columns beyond each edge of the frame.
FINE, BEYOND = 4, 16
#: Radius of a point of light out of focus, and the rms blur of the lens besides, px.
DISC_PX, BLUR_PX = 1.0, 0.3


def _bump(centre_nm: float, width_nm: float) -> Floats:
    return np.asarray(1 / np.cosh((NM - centre_nm) / width_nm))


def _edge(centre_nm: float, width_nm: float) -> Floats:
    return np.asarray(0.5 + 0.5 * np.tanh((NM - centre_nm) / (2 * width_nm)))


#: Reflectance of what is printed on the surface: none of it is on a chart.
SPECTRA = np.stack(
    [
        0.82 - 0.08 * _edge(470, -12),
        0.1 + 0.45 * _edge(592, 12),
        0.12 + 0.4 * _edge(470, -12) + 0.3 * _edge(630, 12),
        0.7 - 0.3 * _bump(529, 12) - 0.35 * _bump(583, 14),
        0.1 + 0.5 * _edge(480, 12) * _edge(550, -14),
        np.full(NM.shape, 0.35),
    ]
)
RESPONSE = np.stack([_bump(600, 28), _bump(535, 32) + 0.1 * _bump(610, 25), _bump(460, 26)])
EMISSION = np.stack([_bump(630, 13) * 0.7, 0.35 * _bump(525, 18) + 0.2 * _bump(575, 22), _bump(456, 14)])
EFFICIENCY = {
    1: 0.12 * (550 / NM) ** 2.3,
    -1: 0.095 * (550 / NM) ** 2.1,
    2: 0.005 * (550 / NM) ** 2,
    -2: 0.004 * (550 / NM) ** 2,
}


def spread_of(distance_px: Floats) -> Floats:
    """Light of a narrow line at even distances (px), 1/px: a disc out of focus seen from the side."""
    step = distance_px[1] - distance_px[0]
    disc = np.sqrt(np.clip(DISC_PX**2 - distance_px**2, 0, None))
    blurred = np.convolve(disc, np.exp(-0.5 * (distance_px / BLUR_PX) ** 2), "same")
    return np.asarray(blurred / (blurred.sum() * step))


def rig(width_px: int, height_px: int) -> Rig:
    """The true calibration; its line spread is the disc's, in Gaussians as records hold it."""
    cosine, sine = np.cos(0.09), np.sin(0.09)
    places = np.arange(-256, 257) / 64
    centres = np.arange(-16, 17) / 8
    each = np.exp(-0.5 * ((places[:, None] - centres) * 8) ** 2) * 8 / np.sqrt(2 * np.pi)
    return Rig(
        name="independent",
        camera=Lens(
            width_px=890, height_px=580, fx_px=1750.0, fy_px=1752.0, cx_px=440.0, cy_px=292.0,
            distortion=(-0.2, 0.1, -0.001, 0.0008, 0.3),
        ).resized(width_px, height_px),
        projector=Lens(
            width_px=640, height_px=360, fx_px=985.0, fy_px=985.0, cx_px=332.0, cy_px=250.0,
            distortion=(-0.02, 0.2, 0.0005, 0.001, -0.6),
        ),
        pose=Pose(
            rotation=((cosine, 0.0, sine), (0.0, 1.0, 0.0), (-sine, 0.0, cosine)),
            translation_mm=(-62.0, 40.0, 12.0),
        ),
        film=Film(lines_per_mm=490.0, tilt_x_deg=0.3, tilt_y_deg=-0.4, roll_deg=0.2, bend_per_mm=0.0015),
        response=_curves(RESPONSE),
        emission=_curves(EMISSION),
        efficiency={order: SpectralCurve.of(NM, values) for order, values in EFFICIENCY.items()},
        sensor=Sensor(read_noise_dn=1.0),
        projector_response=ProjectorResponse().with_spread(
            LineSpread.of(nnls(each, spread_of(places))[0], 0.125)
        ),
        white_scale=13.0,
        column_std_px=0.0,
    )  # fmt: skip


def _curves(values: Floats) -> Rgb:
    red, green, blue = (SpectralCurve.of(NM, each) for each in values)
    return red, green, blue


@dataclass(frozen=True)
class Rendered:
    """A scan, the true depth (rows, columns, mm) and which of `SPECTRA` each pixel sees (rows, columns)."""

    scan: MemoryScan
    depth_mm: Floats
    material: NDArray[np.intp]


def render(known: Rig, plan: CapturePlan) -> Rendered:
    """A scan of a tilted plane of printed patches, with noise."""
    lens = known.camera
    rows, columns = np.divmod(np.arange(lens.width_px * lens.height_px), lens.width_px)
    pixels = np.stack([columns, rows], 1).astype(np.float64)
    points, material, shading = _seen(known, pixels)
    transport = shading[:, None] * _transport(known, points, material, rows % 2 + columns % 2)
    random = np.random.default_rng(12)
    plan = plan.sized(lens, known.projector)
    frames = []
    for shot in plan.shots():
        levels = pattern_image(plan, shot)[0, :, 1] / 255
        dn = shot.exposure_ms * (transport @ levels**known.projector_response.gamma)
        sensor = known.sensor
        noise = np.sqrt(dn.clip(0) / sensor.electrons_per_dn + sensor.read_noise_dn**2)
        values = np.round(sensor.black_level_dn + dn + noise * random.standard_normal(dn.shape))
        frames.append(values.clip(0, 4095).astype(np.uint16).reshape(lens.height_px, lens.width_px))
    shape = frames[0].shape
    return Rendered(
        MemoryScan(plan, tuple(frames)),
        points[:, 2].reshape(shape),
        material.reshape(shape),
    )


def _seen(known: Rig, pixels: Floats) -> tuple[Floats, NDArray[np.intp], Floats]:
    """Points (n, 3, mm) of the plane behind pixels (n, 2), their materials and shading."""
    lens = known.camera
    wanted = (pixels - [lens.cx_px, lens.cy_px]) / [lens.fx_px, lens.fy_px]
    xy = _newton(lambda at: _bent(lens, at) - wanted, wanted.copy())
    across, down = np.array([0.95, 0.02, 0.3]), np.array([0.0, 0.97, -0.22])
    normal = np.cross(down, across) / np.linalg.norm(np.cross(down, across))
    rays = np.column_stack([xy, np.ones(len(xy))])
    points = rays * (normal @ [0.0, 0.0, 720.0] / (rays @ normal))[:, None]
    place = np.linalg.lstsq(np.stack([across, down], 1), (points - [0, 0, 720.0]).T, rcond=None)[0]
    material = (np.floor(place[0] / 130) + 2 * np.floor(place[1] / 110)).astype(np.intp) % len(SPECTRA)
    towards = known.pose.projector_centre_mm - points
    distance = np.linalg.norm(towards, axis=1)
    cosine = np.abs(towards @ normal) / distance
    return points, material, cosine * (known.reference_distance_mm / distance) ** 2


def _bent(lens: Lens, xy: Floats) -> Floats:
    """Where a lens with distortion puts directions (n, 2), by the formulas of OpenCV."""
    k1, k2, p1, p2, k3 = lens.distortion
    x, y = xy.T
    r2 = x * x + y * y
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    return np.stack(
        [
            x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
        ],
        1,
    )


def _newton(off: Callable[[Floats], Floats], start: Floats) -> Floats:
    """Pairs (n, 2) at which a function of pairs is zero."""
    at, step = start, 1e-6 * np.eye(2)
    for _ in range(6):
        value = off(at)
        slopes = np.stack([(off(at + each) - value) / 1e-6 for each in step], -1)
        at = at - np.linalg.solve(slopes, value[..., None])[..., 0]
    return at


def _on_film(known: Rig, uv: Floats) -> tuple[Floats, Floats, Floats]:
    """Points of the film (n, 3) at places across and along its lines, and its directions there."""
    film = known.film
    ax, ay, az = np.radians([film.tilt_x_deg, film.tilt_y_deg, film.roll_deg])
    turn = [
        np.array([[1, 0, 0], [0, np.cos(ax), -np.sin(ax)], [0, np.sin(ax), np.cos(ax)]]),
        np.array([[np.cos(ay), 0, np.sin(ay)], [0, 1, 0], [-np.sin(ay), 0, np.cos(ay)]]),
        np.array([[np.cos(az), -np.sin(az), 0], [np.sin(az), np.cos(az), 0], [0, 0, 1]]),
    ]
    across, along, out = (turn[1] @ turn[0] @ turn[2]).T
    u, v = uv[:, :1], uv[:, 1:]
    places = np.array([0, 0, film.distance_mm]) + u * across + v * along + film.bend_per_mm / 2 * u**2 * out
    tangent = across + film.bend_per_mm * u * out
    return places, tangent / np.linalg.norm(tangent, axis=1, keepdims=True), along


def _columns(known: Rig, points: Floats, order: int, nm: float) -> Floats:
    """Projector columns (n,) from which light reaches points in the projector's frame."""

    def off(uv: Floats) -> Floats:
        at, across, along = _on_film(known, uv)
        change = (points - at) / np.linalg.norm(points - at, axis=1, keepdims=True)
        change = change - at / np.linalg.norm(at, axis=1, keepdims=True)
        bent = (change * across).sum(1) + order * nm / known.film.period_nm
        return np.stack([bent, change @ along], 1)

    start = points[:, :2] * (known.film.distance_mm / points[:, 2:])
    start[:, 0] += known.film.distance_mm * order * nm / known.film.period_nm
    at = _on_film(known, _newton(off, start))[0]
    lens = known.projector
    return np.asarray(_bent(lens, at[:, :2] / at[:, 2:])[:, 0] * lens.fx_px + lens.cx_px)


def _transport(known: Rig, points: Floats, material: NDArray[np.intp], colour: NDArray[np.intp]) -> Floats:
    """DN per ms that each column (columns) adds to each point (n, columns), unshaded."""
    width = known.projector.width_px
    # An odd number of samples, or convolutions would move all light by half of one.
    grid = np.arange(-256, 257) / 64
    box = np.clip(32.5 - np.abs(np.arange(-256, 257)), 0, 1) / 64
    column = np.convolve(spread_of(grid), box, "same")
    inside = points @ known.pose.matrix.T + known.pose.vector_mm
    light = known.white_scale * EMISSION.sum(0) * RESPONSE[colour] * SPECTRA[material]
    xy = _bent(known.projector, inside[:, :2] / inside[:, 2:])
    zero = xy[:, 0] * known.projector.fx_px + known.projector.cx_px
    transport = light.sum(1)[:, None] * np.interp(np.arange(width) - zero[:, None], grid, column, 0, 0)
    between = np.linalg.solve(np.vander(NODES_NM / 550 - 1), np.eye(8))
    between = np.vander(NM / 550 - 1, 8) @ between
    fine = np.zeros((len(points), (width + 2 * BEYOND) * FINE))
    for order, efficiency in EFFICIENCY.items():
        nodes = np.stack([_columns(known, inside, order, float(nm)) for nm in NODES_NM])
        place = ((between @ nodes).T + BEYOND) * FINE
        there = (place > 0) & (place < fine.shape[1] - 1)
        row, at = np.nonzero(there)[0], place[there]
        amount, whole = (light * efficiency)[there], np.floor(at).astype(np.intp)
        for share, index in ((1 - (at - whole), whole), (at - whole, whole + 1)):
            flat = np.bincount(row * fine.shape[1] + index, amount * share, fine.size)
            fine += flat.reshape(fine.shape)
    centres = np.arange(fine.shape[1]) / FINE - BEYOND
    return np.asarray(transport + fine @ np.interp(np.arange(width) - centres[:, None], grid, column, 0, 0))

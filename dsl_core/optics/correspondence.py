"""Which projector column lights a camera pixel, through which order, at which wavelength.

Three models answer through the same call: the grating equation with the film's pose; the same with a small
smooth correction; and the published data-driven fit, ``q = alpha * z**beta + gamma``. The first two are
smooth in wavelength, so they are evaluated at a few Chebyshev nodes and interpolated by a polynomial.
Equations are those of the supplement of "Dispersed Structured Light" (Shin et al., CVPR 2024).
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple, Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.errors import CalibrationError
from dsl_core.model.geometry import Lens, Pose
from dsl_core.model.rig import BayerPattern, CorrespondenceGrid, Rig
from dsl_core.optics.column_residual import residual_columns
from dsl_core.optics.grating import FilmFrame, Vectors, incoming_direction
from dsl_core.optics.pinhole import KEPT_PX, project, rays_at, rays_in
from dsl_core.optics.sensor import bayer_channels

#: Chebyshev nodes over the wavelength range. With 480 lines/mm and light of 415 to 675 nm, the interpolation
#: is wrong by up to 0.04 px in first orders and 0.25 px in second ones.
NODES = 6
#: Beyond so many widths of the frame, light is close to grazing incidence, where no polynomial follows it.
GRAZING = 10
#: Steps that refine a triangulated depth.
NEWTON_STEPS = 4
#: Pixels solved at once.
CHUNK = 8192
#: Of large pictures rays are kept by so many rows; pixels spread over more of these blocks are few.
ROWS, BLOCKS = 64, 4


class Footprint(NamedTuple):
    """Projector columns and rows (px) that light some pixels, each of shape (wavelengths, pixels)."""

    columns: Tensor
    rows: Tensor

    def inside(self, width_px: int, height_px: int, margin_px: float = 0.0) -> Tensor:
        """Whether light comes from inside the projector's frame, or a margin left and right of it; bool."""
        c, r = self
        found = (c - 0.5 * (width_px - 1)).abs_() < 0.5 * width_px + margin_px
        found &= (r - 0.5 * (height_px - 1)).abs_() < 0.5 * height_px
        return found


class Correspondence(Protocol):
    """A model of the projector pixel of every (camera pixel, depth, order, wavelength)."""

    def trace(
        self, pixels: Tensor, depth_mm: Tensor, order: int, wavelengths_nm: NDArray[np.float64]
    ) -> Footprint:
        """Projector pixels that light camera pixels.

        ``pixels`` are flat indices into the camera image (int64), ``depth_mm`` has the same shape.
        """


def _rays_in_projector(camera: Lens, pose: Pose, pixels: Tensor, like: Tensor) -> Tensor:
    """Directions of pixels' rays in the projector's coordinates, (3, n), of the kind that ``like`` is."""
    kind = like.device, like.dtype
    if camera.width_px * camera.height_px <= KEPT_PX or pixels.numel() == 0:
        return _rays_of_rows(camera, pose, 0, camera.height_px, *kind)[:, pixels]
    first, last = (int(at) // camera.width_px // ROWS for at in torch.aminmax(pixels))
    if last - first >= BLOCKS:
        at = pixels.cpu().numpy()
        rays = rays_at(camera, (at % camera.width_px).astype(float), (at // camera.width_px).astype(float))
        return torch.as_tensor(np.einsum("ij,jn->in", pose.matrix, rays)).to(like)
    parts = [_rays_of_rows(camera, pose, k * ROWS, (k + 1) * ROWS, *kind) for k in range(first, last + 1)]
    return torch.cat(parts, 1)[:, pixels - first * ROWS * camera.width_px]


@lru_cache(maxsize=8)
def _rays_of_rows(
    camera: Lens, pose: Pose, first: int, last: int, device: torch.device, dtype: torch.dtype
) -> Tensor:
    rays = np.einsum("ij,jhw->ihw", pose.matrix, rays_in(camera, slice(first, last))).reshape(3, -1)
    return torch.as_tensor(np.ascontiguousarray(rays), device=device, dtype=dtype)


@lru_cache(maxsize=8)
def _mosaic(bayer: BayerPattern, height: int, width: int) -> Tensor:
    """Colour, 0 to 2, of every pixel of a picture, flat."""
    return torch.as_tensor(bayer_channels(bayer, height, width).astype(np.uint8).ravel())


def of_colours(values: tuple[float, float, float], rig: Rig, pixels: Tensor, other: Tensor) -> Tensor:
    """That of three values which belongs to the colour of each pixel."""
    colours = _mosaic(rig.sensor.bayer, rig.camera.height_px, rig.camera.width_px)[pixels.cpu()].long()
    return like(np.array(values), other)[colours.to(other.device)]


def projector_points(rig: Rig, pixels: Tensor, depth_mm: Tensor) -> Vectors:
    """Points seen by flat pixel indices at a depth, in projector coordinates (mm), shape of ``depth_mm``."""
    rays = _rays_in_projector(rig.camera, rig.pose, pixels, depth_mm)
    t = rig.pose.translation_mm
    if rig.lateral_colour is not None:
        # A colour that the camera's lens magnifies comes from nearer to its axis, which is where z is.
        axis = like(rig.pose.matrix[:, 2], rays)[:, None]
        rays = axis + (rays - axis) / (1 + of_colours(rig.lateral_colour.camera, rig, pixels, rays))
    return Vectors(*(rays[i] * depth_mm + t[i] for i in range(3)))


def zero_order(rig: Rig, pixels: Tensor, depth_mm: Tensor) -> tuple[Tensor, Tensor]:
    """Projector column and row (px) of the zero order: conventional structured light, Eqs. (9) to (11)."""
    column, row = project(rig.projector, *projector_points(rig, pixels, depth_mm))
    if rig.lateral_colour is None:
        return column, row
    return _magnified(
        rig, column, row, of_colours(rig.lateral_colour.projector_of_white, rig, pixels, column)
    )


def _magnified(rig: Rig, column: Tensor, row: Tensor, by: Tensor) -> tuple[Tensor, Tensor]:
    """Projector pixels of light that the projector's lens magnifies by a share more than calibrated."""
    lens = rig.projector
    return column + (column - lens.cx_px) * by, row + (row - lens.cy_px) * by


def triangulate(rig: Rig, pixels: Tensor, column_px: Tensor) -> tuple[Tensor, Tensor]:
    """Depth (mm) at flat pixel indices from projector columns (px), and its slope (mm per px).

    The start is the closed form without projector distortion (Eqs. 9 to 11 solved for z); Newton steps
    with the full model follow. NaN where ray and column do not meet in front of the camera.
    """
    z = _closed_form(rig, pixels, column_px)
    low, high = rig.depth_range_mm
    z = z.clip(0.3 * low, 3 * high)
    for _ in range(NEWTON_STEPS):
        here, slope = _column_and_slope(rig, pixels, z)
        # A column is nearly linear in inverse depth, whatever the baseline: Newton's step is taken there.
        nearer = 1 + (here - column_px) / (slope * z)
        z = (z / nearer.clip(min=0.01)).clip(0.1 * low, 10 * high)
    here, slope = _column_and_slope(rig, pixels, z)
    met = (here - column_px).abs() < 0.01
    return torch.where(met, z, torch.nan), 1 / slope.abs()


def _column_and_slope(rig: Rig, pixels: Tensor, z: Tensor) -> tuple[Tensor, Tensor]:
    """Zero-order column (px) at a depth and its change per mm."""
    here = zero_order(rig, pixels, z)[0]
    ahead = zero_order(rig, pixels, z + 1.0)[0]
    slope = ahead - here
    return here, torch.where(slope.abs() < 1e-6, torch.full_like(slope, -1e-6), slope)


def _closed_form(rig: Rig, pixels: Tensor, column_px: Tensor) -> Tensor:
    far = projector_points(rig, pixels, torch.ones_like(column_px))
    tx, _, tz = rig.pose.translation_mm
    ray_x, ray_z = far.x - tx, far.z - tz
    u = (column_px - rig.projector.cx_px) / rig.projector.fx_px
    return (u * tz - tx) / (ray_x - u * ray_z)


def chebyshev_nodes(start_nm: float, stop_nm: float, count: int = NODES) -> NDArray[np.float64]:
    """Chebyshev nodes of the first kind over a wavelength range, nm, rising, (count,)."""
    k = np.arange(count)[::-1]
    return np.asarray(
        0.5 * (start_nm + stop_nm) + 0.5 * (stop_nm - start_nm) * np.cos(np.pi * (k + 0.5) / count)
    )


def interpolation_matrix(nodes: NDArray[np.float64], targets: NDArray[np.float64]) -> NDArray[np.float64]:
    """Matrix (targets, nodes) of Lagrange's polynomial interpolation from values at nodes."""

    def scale(nm: NDArray[np.float64]) -> NDArray[np.float64]:
        # Near -0.5 to 0.5, which keeps the Vandermonde matrix well conditioned.
        return np.asarray((nm - nodes.mean()) / np.ptp(nodes))

    order = len(nodes) - 1
    return np.asarray(
        np.linalg.solve(np.vander(scale(nodes), order + 1).T, np.vander(scale(targets), order + 1).T).T
    )


def like(array: NDArray[np.floating[Any]], other: Tensor) -> Tensor:
    """The array as a tensor of another tensor's device and type."""
    return torch.as_tensor(array, device=other.device, dtype=other.dtype)


def _zero_footprint(rig: Rig, pixels: Tensor, depth_mm: Tensor, count: int) -> Footprint:
    column, row = zero_order(rig, pixels, depth_mm)
    return Footprint(column.expand(count, -1), row.expand(count, -1))


def wavelength_range(wavelengths_nm: NDArray[np.float64]) -> tuple[float, float]:
    """First and last wavelength, widened where they are equal so that nodes stay apart."""
    low, high = float(wavelengths_nm.min()), float(wavelengths_nm.max())
    return (low, high) if high - low > 1 else (low - 1, high + 1)


class GratingModel:
    """The analytic model: grating equation with the film's pose, period and bend."""

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self.film = FilmFrame.of(rig.film)

    def exact(
        self, pixels: Tensor, depth_mm: Tensor, order: int, wavelengths_nm: NDArray[np.float64]
    ) -> Footprint:
        """Projector pixels solved at every wavelength, without interpolation."""
        nm = like(wavelengths_nm, depth_mm)[:, None]
        columns = torch.empty(
            (len(wavelengths_nm), len(pixels)), device=depth_mm.device, dtype=depth_mm.dtype
        )
        rows = torch.empty_like(columns)
        # In chunks, so that the dozens of intermediate arrays stay in the cache.
        for i in range(0, len(pixels), CHUNK):
            part = slice(i, i + CHUNK)
            point = projector_points(self.rig, pixels[part], depth_mm[part])
            seen = project(self.rig.projector, *incoming_direction(self.film, point, order, nm))
            if self.rig.lateral_colour is not None:
                magnified = like(self.rig.lateral_colour.projector(wavelengths_nm), depth_mm)[:, None]
                seen = _magnified(self.rig, *seen, magnified)
            columns[:, part], rows[:, part] = seen
        return Footprint(columns, rows)

    def columns_of(
        self, pixels: Tensor, depth_mm: Tensor, orders: NDArray[np.int64], wavelengths_nm: NDArray[np.float64]
    ) -> Tensor:
        """Projector columns (px) of light of one order and wavelength at each pixel; all are (n,)."""
        path_nm = like(orders * wavelengths_nm, depth_mm)
        columns = torch.empty_like(depth_mm)
        for i in range(0, len(pixels), CHUNK):
            part = slice(i, i + CHUNK)
            point = projector_points(self.rig, pixels[part], depth_mm[part])
            seen = project(self.rig.projector, *incoming_direction(self.film, point, 1, path_nm[part]))
            if self.rig.lateral_colour is not None:
                magnified = like(self.rig.lateral_colour.projector(wavelengths_nm[part]), depth_mm)
                seen = _magnified(self.rig, *seen, magnified)
            columns[part] = seen[0]
        return columns

    def trace(
        self, pixels: Tensor, depth_mm: Tensor, order: int, wavelengths_nm: NDArray[np.float64]
    ) -> Footprint:
        """Projector pixels, solved at Chebyshev nodes and interpolated in wavelength."""
        if order == 0:
            return _zero_footprint(self.rig, pixels, depth_mm, len(wavelengths_nm))
        nodes = chebyshev_nodes(*wavelength_range(wavelengths_nm))
        matrix = like(interpolation_matrix(nodes, wavelengths_nm), depth_mm)
        at_nodes = self.exact(pixels, depth_mm, order, nodes)
        seen = Footprint(*(matrix @ q for q in at_nodes))
        width, height = self.rig.projector.width_px, self.rig.projector.height_px
        grazing = (at_nodes.columns.abs() > GRAZING * width).any(0)
        if bool(grazing.any()):
            # Between such nodes the polynomial swings through the frame, where there is no light.
            again = torch.nonzero(grazing & seen.inside(width, height, width).any(0)).ravel()
            solved = self.exact(pixels[again], depth_mm[again], order, wavelengths_nm)
            for found, right in zip(seen, solved, strict=True):
                found[:, again] = right
        return seen


class HybridModel(GratingModel):
    """The grating equation plus the rig's smooth residual; rows stay those of the grating."""

    def __init__(self, rig: Rig) -> None:
        super().__init__(rig)
        if rig.residual is None:
            raise CalibrationError(
                f"Rig {rig.name!r} has no residual of the grating equation; run the depth-stage calibration"
                " or use the analytic model."
            )
        self.residual = rig.residual

    def exact(
        self, pixels: Tensor, depth_mm: Tensor, order: int, wavelengths_nm: NDArray[np.float64]
    ) -> Footprint:
        """Projector pixels at every wavelength, residual included."""
        seen = super().exact(pixels, depth_mm, order, wavelengths_nm)
        width = self.rig.camera.width_px
        nm = like(wavelengths_nm, depth_mm)
        for i in range(0, len(pixels), CHUNK):
            part = slice(i, i + CHUNK)
            camera_px = (pixels[part] % width).to(depth_mm), (pixels[part] // width).to(depth_mm)
            more = residual_columns(self.residual, camera_px, depth_mm[part], order, nm)
            if more is not None:
                seen.columns[:, part] += more
        return seen


class GridModel:
    """The published data-driven model, Eq. (2): a power of depth, linear in wavelength, cubic in pixel."""

    def __init__(self, rig: Rig) -> None:
        if rig.correspondence is None:
            raise CalibrationError(
                f"Rig {rig.name!r} has no data-driven correspondence; run the depth-stage calibration"
                " or use the analytic model."
            )
        self.rig = rig
        self.grid = rig.correspondence

    def trace(
        self, pixels: Tensor, depth_mm: Tensor, order: int, wavelengths_nm: NDArray[np.float64]
    ) -> Footprint:
        """Projector pixels; the rows, which the fit does not cover, are those of the analytic model.

        Raises `CalibrationError` for an order that the fit does not cover.
        """
        if order == 0:
            return _zero_footprint(self.rig, pixels, depth_mm, len(wavelengths_nm))
        if abs(order) > 1:
            # Too faint to be calibrated; the grating equation places them well enough.
            return GratingModel(self.rig).trace(pixels, depth_mm, order, wavelengths_nm)
        if order not in self.grid.orders:
            raise CalibrationError(
                f"The data-driven correspondence covers orders {self.grid.orders}, not {order}."
            )
        alpha, beta, gamma = self._coefficients(order, pixels, depth_mm)
        at_nodes = alpha * (depth_mm / self.grid.depth_unit_mm) ** beta + gamma
        matrix = like(_linear_matrix(np.array(self.grid.wavelengths_nm), wavelengths_nm), depth_mm)
        rows = GratingModel(self.rig).trace(pixels, depth_mm, order, wavelengths_nm).rows
        return Footprint(matrix @ at_nodes, rows)

    def _coefficients(self, order: int, pixels: Tensor, depth_mm: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Alpha, beta, gamma at flat pixels, each (wavelength nodes, pixels)."""
        full = _upsampled(self.grid, order, self.rig.camera.width_px, self.rig.camera.height_px)
        at = like(full, depth_mm)[:, :, pixels]
        return at[0], at[1], at[2]


@lru_cache(maxsize=4)
def _upsampled(grid: object, order: int, width: int, height: int) -> NDArray[np.float32]:
    """Coefficients of every pixel, shape (3, wavelengths, pixels), by cubic splines over the grid."""
    from scipy.interpolate import make_interp_spline

    assert isinstance(grid, CorrespondenceGrid)
    nodes = grid.array[grid.orders.index(order)]
    rows = make_interp_spline(np.array(grid.rows_px), nodes, k=min(3, len(grid.rows_px) - 1), axis=1)(
        np.arange(height)
    )
    both = make_interp_spline(np.array(grid.columns_px), rows, k=min(3, len(grid.columns_px) - 1), axis=2)(
        np.arange(width)
    )
    return np.ascontiguousarray(np.moveaxis(both, 3, 0), np.float32).reshape(3, len(grid.wavelengths_nm), -1)


def _linear_matrix(nodes: NDArray[np.float64], targets: NDArray[np.float64]) -> NDArray[np.float64]:
    """Matrix (targets, nodes) of linear interpolation, extrapolating with the outermost pair."""
    i = np.clip(np.searchsorted(nodes, targets) - 1, 0, len(nodes) - 2)
    t = (targets - nodes[i]) / (nodes[i + 1] - nodes[i])
    matrix = np.zeros((len(targets), len(nodes)))
    matrix[np.arange(len(targets)), i] = 1 - t
    matrix[np.arange(len(targets)), i + 1] += t
    return matrix


def correspondence(rig: Rig, model: str = "auto") -> Correspondence:
    """The requested model: ``grating``, ``hybrid``, ``grid``, or ``auto``.

    ``auto`` is hybrid where the rig holds a residual, else grid where it holds one, else grating. Raises
    `CalibrationError` for another name, and for a model that the rig lacks the data of.
    """
    if model == "auto":
        model = "grid" if rig.correspondence is not None else "grating"
        model = "hybrid" if rig.residual is not None else model
    models: dict[str, type[GratingModel] | type[GridModel]] = {
        "grating": GratingModel,
        "hybrid": HybridModel,
        "grid": GridModel,
    }
    if model not in models:
        raise CalibrationError(
            f"There is no correspondence model {model!r}; choose auto, grating, hybrid or grid."
        )
    return models[model](rig)

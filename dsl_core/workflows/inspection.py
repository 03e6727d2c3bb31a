"""The intensity graph of a pixel: what it saw while the lines went by, and what the model expects.

Along the lines a pixel lights up three times: through the zero order, in its own colour, and through the
two first orders, each wavelength at its own line (Figs. 2 and 3 of the supplement of Shin et al., CVPR 2024).
Measured against model, the graph shows at a glance what is wrong with a pixel.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import CalibrationError, DecodeError, StoreError
from dsl_core.io import MANIFEST_NAME
from dsl_core.io.calibration_library import CalibrationLibrary
from dsl_core.io.result.result_arrays import ResultArrays
from dsl_core.io.scan.as_exposed import as_exposed
from dsl_core.io.scan.check import require_complete
from dsl_core.io.scan.folder import ScanReader
from dsl_core.io.scan.manifest import read_manifest
from dsl_core.io.scan.origin import calibration_digest, model_of_notes
from dsl_core.model.plan import CapturePlan, Shot
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.demosaic import demosaic, demosaic_variance
from dsl_core.optics.spectra import ORDERS
from dsl_core.progress import NoProgress, Progress
from dsl_core.reconstruction.merge import MergedScan
from dsl_core.workflows.scans import calibration_of

Floats = NDArray[np.float64]
#: Half size of the neighbourhood that is read at once, so that nearby pixels need no second look at the disk.
HALF_PX = 24


@dataclass(frozen=True)
class IntensityGraph:
    """One pixel, (x, y) in the camera's picture, over the frames of its pattern set.

    ``measured``, ``std`` and ``model`` have shape (3, frames), of a monochrome camera (1, frames), DN per ms;
    the model is None where the pixel has no spectrum. ``zero`` is the frame of the zero order, ``orders`` the
    frame of each wavelength through +1 and -1 (NaN where the light would start outside the projector's
    frame); both are empty for pattern sets in which a frame shows several lines.
    """

    pixel: tuple[int, int]
    measured: Floats
    std: Floats
    model: Floats | None
    zero: float | None
    orders: dict[int, Floats]
    wavelengths_nm: Floats


def find_scan(result: ResultArrays) -> Path:
    """The scan that a result was made from, next to it; raises `StoreError` when it is not there."""
    return scan_of(result.path, result.attributes)


def scan_of(path: Path, attributes: Mapping[Any, Any]) -> Path:
    """The scan next to a result with these attributes; raises `StoreError` when it is not there."""
    captured = attributes.get("captured")
    for folder in sorted(path.parent.glob("*.dsl")):
        if (folder / MANIFEST_NAME).is_file() and read_manifest(folder).created == captured:
            return folder
    raise StoreError(
        f"This needs the frames of the scan, and the scan of {path.name}{_when(captured)} is not in"
        f" {path.parent}. Put it there; the examples of the program come without their frames."
    )


def _when(captured: object) -> str:
    """When a scan was captured, in words; empty where that is not known."""
    return f", captured on {str(captured)[:16].replace('T', ' at ')} UTC," if captured else ""


class _Cropped:
    """A frame source of a part of the picture."""

    def __init__(self, reader: ScanReader, rows: slice, columns: slice) -> None:
        self.reader, self.rows, self.columns = reader, rows, columns

    @property
    def plan(self) -> CapturePlan:
        return self.reader.plan

    def read(self, shot: Shot) -> NDArray[np.uint16]:
        return np.ascontiguousarray(self.reader.read(shot, verify=False)[self.rows, self.columns])


@dataclass(frozen=True)
class FrameBlock:
    """Merged line frames (frames, rows, columns) of a part of the picture from ``origin`` (x, y) on."""

    radiance: NDArray[np.float32]
    variance: NDArray[np.float32]
    origin: tuple[int, int]
    rig: Rig
    plan: CapturePlan

    def holds(self, pixel: tuple[int, int]) -> bool:
        """Whether a pixel (x, y) of the picture is in the block with the neighbours demosaicing needs."""
        count = self.radiance.shape[:0:-1]
        for at, first, many, size in zip(pixel, self.origin, count, self.plan.camera_size_px, strict=True):
            low = first + (2 if first > 0 else 0)
            high = first + many - (2 if first + many < size else 0)
            if not low <= at < high:
                return False
        return True


def read_block(result: ResultArrays, pixel: tuple[int, int], progress: Progress | None = None) -> FrameBlock:
    """Read the frames of a result's scan around its pixel (x, y); raises `StoreError`, `CalibrationError`."""
    progress, reader = progress or NoProgress(), ScanReader(find_scan(result))
    require_complete(reader)
    rig = _calibration(reader, result)
    reader = as_exposed(reader, rig.sensor)
    plan = reader.plan
    width, height = plan.camera_size_px
    # Even corners keep the phase of the Bayer mosaic.
    at_x, at_y = result.in_picture(pixel)
    left, top = (max(at - HALF_PX, 0) // 2 * 2 for at in (at_x, at_y))
    rows = slice(top, min(at_y + HALF_PX, height))
    columns = slice(left, min(at_x + HALF_PX, width))
    scan = MergedScan(_Cropped(reader, rows, columns), rig)
    shape = (plan.spectral_count, rows.stop - rows.start, columns.stop - columns.start)
    radiance, variance = np.empty(shape, np.float32), np.empty(shape, np.float32)
    for k in range(shape[0]):
        progress.report("read the frames of a pixel", k, shape[0])
        merged = scan.merge("spectral", k)
        radiance[k], variance[k] = merged.radiance, merged.variance
    return FrameBlock(radiance, variance, (left, top), rig, plan)


def _calibration(reader: ScanReader, result: ResultArrays) -> Rig:
    """The calibration that a result was made with: the scan's own, or one of the library."""
    digest, _ = model_of_notes(result.attributes)
    own = reader.calibration
    # Results of older versions do not say; most were made with the scan's own calibration.
    if digest is None or (own is not None and calibration_digest(own) == digest):
        return calibration_of(reader)
    for line in CalibrationLibrary().lines():
        if line.entry is not None and calibration_digest(line.entry.rig) == digest:
            return line.entry.rig
    raise CalibrationError(
        f"{result.path.name} was made with a calibration other than that of its scan, and the library does"
        " not have it, so nothing can be predicted for a pixel. Import that calibration into the library, or"
        " reconstruct the scan with its own."
    )


def intensity_graph(block: FrameBlock, result: ResultArrays, pixel: tuple[int, int]) -> IntensityGraph:
    """What a pixel (x, y) of a result saw; raises `DecodeError` when it is outside the block."""
    at = result.in_picture(pixel)
    if not block.holds(at):
        raise DecodeError(f"Pixel {at[0]}, {at[1]} is outside the frames that were read. Read its own.")
    x, y = at[0] - block.origin[0], at[1] - block.origin[1]
    # A neighbourhood with an even corner, large enough for bilinear demosaicing.
    left, top = max(x - 2, 0) // 2 * 2, max(y - 2, 0) // 2 * 2
    part = np.s_[:, top : y + 3, left : x + 3]
    bayer = block.rig.sensor.bayer
    measured = demosaic(block.radiance[part], bayer)[:, :, y - top, x - left].T
    variance = demosaic_variance(block.variance[part], bayer)[:, :, y - top, x - left].T
    model, zero, orders = _expected(block, result, pixel)
    # All three colours of a monochrome camera are the same.
    count = 1 if bayer == "MONO" else 3
    return IntensityGraph(
        at,
        np.asarray(measured[:count], np.float64),
        np.sqrt(np.asarray(variance[:count], np.float64)),
        None if model is None else model[:count],
        zero,
        orders,
        result.wavelengths_nm,
    )


def _expected(
    block: FrameBlock, result: ResultArrays, pixel: tuple[int, int]
) -> tuple[Floats | None, float | None, dict[int, Floats]]:
    """The model's signals and where in the frames each order falls, as far as the result knows."""
    import torch

    from dsl_core.optics.correspondence import correspondence
    from dsl_core.optics.pixel_model import demosaic_blur_px
    from dsl_core.reconstruction.spectral.spectra import model_of_plan

    depth, column = (float(result.at(name, pixel)) for name in ("depth_mm", "column_px"))
    if not (np.isfinite(depth) and np.isfinite(column)):
        return None, None, {}
    rig, nm = block.rig, result.wavelengths_nm
    step = float(nm[1] - nm[0]) if len(nm) > 1 else 5.0
    grid = WavelengthGrid(start_nm=nm[0], stop_nm=nm[-1], step_nm=step) if len(nm) > 1 else WavelengthGrid()
    model = model_of_plan(rig, block.plan, grid, correspondence(rig, model_of_notes(result.attributes)[1]))
    at = result.in_picture(pixel)
    flat = at[1] * block.plan.camera_size_px[0] + at[0]
    place = torch.tensor([flat]), torch.tensor([depth], dtype=torch.float64)
    traced = model.trace(*place, torch.tensor([column], dtype=torch.float64))
    zero, orders = None, {}
    if model.single and model.lines is not None:
        zero = model.lines.position(column)
        for order in ORDERS:
            seen = model.correspondence.trace(*place, order, grid.centres_nm)
            frame = model.lines.position(seen.columns)
            reached = model.reaches(order, seen, grid.centres_nm)
            orders[order] = np.where(reached, frame, np.nan)[:, 0]
    spectrum = result.at("reflectance", pixel) if result.has_spectra else np.array([np.nan])
    shading = float(result.at("shading", pixel)) if "shading" in result.arrays else np.nan
    if not np.isfinite(spectrum).all() or not np.isfinite(shading):
        return None, zero, orders
    x, y = pixel
    blur_px = demosaic_blur_px(result["column_px"][max(y - 2, 0) : y + 3, max(x - 2, 0) : x + 3])
    reflectance = np.interp(model.bands.centres_nm, nm, spectrum)
    operator = model.operator(traced, torch.tensor([shading], dtype=torch.float64), blur_px)
    return operator.forward(torch.as_tensor(reflectance)[:, None])[..., 0].numpy(), zero, orders

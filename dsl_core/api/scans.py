"""From a rig to a result: open, plan, scan, reconstruct."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import ValidationError

from dsl_core.api import FilePath, path_of, path_text
from dsl_core.api.places import as_array, whole_numbers
from dsl_core.devices.base import DeviceRig
from dsl_core.devices.registry import default_options, rig_names
from dsl_core.devices.registry import open_rig as open_by_texts
from dsl_core.errors import CalibrationError, DecodeError, PlanError
from dsl_core.extras import names_missing_packages
from dsl_core.io import MANIFEST_NAME, calibration_library
from dsl_core.io.scan.folder import ScanReader
from dsl_core.io.scan.manifest import read_manifest
from dsl_core.io.scan.origin import refuse_other_rig, rig_notes
from dsl_core.model.base import problems_in_words, what_is_wrong
from dsl_core.model.options import Options
from dsl_core.model.plan import CUSTOM, CapturePlan
from dsl_core.model.presets import PRESETS, preset_plan
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.progress import Progress
from dsl_core.words import as_given

if TYPE_CHECKING:
    import xarray as xr

    from dsl_core.planning.expected import Prediction


def rigs() -> list[str]:
    """Names of the rigs that `open_rig` knows: the twin, replays, and those of installed packages."""
    return rig_names()


@names_missing_packages
def open_rig(name: FilePath = "twin", **options: object) -> DeviceRig:
    """Open the devices of a rig; use it in a ``with`` statement, so that they are closed.

    ``name`` is one of `rigs`, or the path of a rig profile. ``options`` are those that ``dsl-scan rigs``
    lists, as text, numbers, True and False, or a size as (width, height). Raises `DeviceError` for an unknown
    rig or option, and for devices that cannot be opened. A calibrated rig is read by `load_calibration`.
    """
    name, texts = path_text(name), {key: _as_text(value) for key, value in options.items()}
    rig = open_by_texts(name, texts)
    return replace(rig, notes={**rig.notes, **rig_notes(name, texts)})


def _as_text(value: object) -> str:
    if isinstance(value, bool | np.bool_):
        return "on" if value else "off"
    if isinstance(value, tuple | list | np.ndarray):
        return "x".join(f"{each:g}" if isinstance(each, float) else str(each) for each in value)
    return os.fspath(value) if isinstance(value, os.PathLike) else str(value)


@names_missing_packages
def plan(rig: DeviceRig, preset: str = "reference", **changes: object) -> CapturePlan:
    """What a scan captures: the preset of that name for the picture sizes and exposures of a rig.

    Presets are preview, comb, quick, coarse, balanced, columns and reference. ``changes`` replace fields
    of `CapturePlan`, such as ``settings`` or ``code``; a plan with any is a "custom plan", unless ``name``
    is one of them. Raises `PlanError` for an unknown preset or field, and for a plan that contradicts itself.
    """
    from dsl_core.capture.preflight import fit_plan

    chosen = preset_plan(preset)
    if chosen is None:
        known = ", ".join(each.key for each in PRESETS)
        raise PlanError(f"There is no plan {preset!r}; choose {known}.")
    if changes:
        try:
            chosen = CapturePlan.model_validate({**dict(chosen), "name": CUSTOM, **changes})
        except ValidationError as error:
            raise PlanError(
                f"The plan cannot be changed like this: {problems_in_words(error)}. Its fields are"
                f" {', '.join(CapturePlan.model_fields)}."
            ) from error
    return fit_plan(chosen, rig, keeps_patterns="spectral" in changes)


def _plan(rig: DeviceRig, given: CapturePlan | str) -> CapturePlan:
    return given if isinstance(given, CapturePlan) else plan(rig, given)


@names_missing_packages
def predict(rig: DeviceRig, plan: CapturePlan | str, calibration: Rig | FilePath | None = None) -> Prediction:
    """What a plan, or the preset of that name, is expected to reach on a rig.

    It is predicted with the calibration of the rig unless another is given.

    ``seconds`` is the time of the capture, ``pixel_rmse`` the error of reflectance of a single pixel,
    ``depth_std_mm`` that of depth. Nothing is captured. Raises `CalibrationError` where the rig has no
    calibration, and `PlanError` for a plan without a binary code or spectral patterns.
    """
    from dsl_core.planning import prediction

    known = _calibration(calibration) or rig.calibration
    if known is None:
        raise CalibrationError(
            f"Nothing can be predicted for the rig {rig.name!r}, which has no calibration. Give one, such as"
            ' calibration="rig.json".'
        )
    return prediction.predict(known, _plan(rig, plan), latency_ms=rig.projector.info.latency_ms)


@names_missing_packages
def scan(
    rig: DeviceRig,
    folder: FilePath,
    plan: CapturePlan | str | None = None,
    progress: Progress | None = None,
) -> ScanReader:
    """Capture a plan, or the preset of that name, into a folder, and return the stored scan.

    Without a plan it is the preset ``reference``.

    Every frame is on disk before the next is taken. A folder with an unfinished scan of the same plan and rig
    is resumed, and one with a finished scan is left as it is. Raises `PlanError` for a plan that is
    impossible on the rig, `DeviceError` for a device that fails and `StoreError` where the folder cannot be
    written or contains something else, such as a scan of another rig or with other options.
    """
    from dsl_core import pipeline

    path = path_of(folder)
    if (path / MANIFEST_NAME).exists():
        refuse_other_rig(path, read_manifest(path).notes, rig.notes, default_options)
    pipeline.scan(rig, _plan(rig, plan or "reference"), path, progress, dict(rig.notes))
    return ScanReader(path)


def load_scan(folder: FilePath) -> ScanReader:
    """A scan on disk: its ``plan``, ``calibration`` and ``manifest``, and ``read(shot)`` for a frame.

    Raises `StoreError` where there is none, or where it is damaged.
    """
    return ScanReader(path_of(folder))


def load_calibration(path: FilePath) -> Rig:
    """The calibrated rig of a JSON file, or of a name in this computer's library.

    Names are those that ``dsl-scan calibrations list`` shows. Raises `CalibrationError` naming the fields
    that are wrong, and `StoreError` where there is no such file or name.
    """
    return calibration_library.load_calibration(path_text(path))


@names_missing_packages
def reconstruct(
    scan: ScanReader | FilePath,
    calibration: Rig | FilePath | None = None,
    *,
    bands_nm: tuple[float, float, float] = (430.0, 660.0, 5.0),
    region_px: Sequence[int] | None = None,
    spectra: bool = True,
    solver: str = "best",
    correspondence: str = "auto",
    device: str = "cpu",
    progress: Progress | None = None,
) -> xr.Dataset:
    """Depth, surface and spectra of a scan, with the calibration stored in it unless another is given.

    ``bands_nm`` are the centre of the first and of the last band and their distance. ``region_px`` (x, y,
    width, height) solves spectra in that part of the picture alone and returns only that part; depth, normals
    and the check of the model still use the whole picture. Without ``spectra`` the result ends with depth.
    ``solver`` is best, published, nearest-line or colour-basis, ``correspondence`` auto, grating, hybrid or
    grid, and ``device`` cpu, cuda, auto or another name of torch, all as in `Options`.

    The dataset holds the variables of `dsl_core.model.result.VARIABLES` over pixel coordinates ``x``, ``y``
    and ``wavelength_nm``, float32. Raises `StoreError` for an incomplete or damaged scan, `CalibrationError`
    for a missing or unfitting calibration, `PlanError` for bands, a region, a device or a solver that does
    not exist or does not fit, and `DecodeError` where the frames show no usable light.
    """
    import dsl_core.api.accessor  # noqa: F401  (registers ``.dsl``)
    from dsl_core.workflows.scans import reconstruct_scan

    folder = scan.folder if isinstance(scan, ScanReader) else path_of(scan)
    options = Options(
        grid=_grid(bands_nm),
        correspondence=correspondence,
        spectra=spectra,
        device=_device(device),
        solver=solver,
        region_px=None if region_px is None else _region(region_px, ScanReader(folder).plan.camera_size_px),
    )
    return reconstruct_scan(folder, _calibration(calibration), options, progress)


def _calibration(given: Rig | FilePath | None) -> Rig | None:
    return given if isinstance(given, Rig | None) else load_calibration(given)


def _device(name: str) -> str:
    """A device of torch by its name; raises `PlanError` for one that is not there."""
    from dsl_core.solve.torch_device import torch_device

    try:
        return torch_device(name)
    except DecodeError as error:
        raise PlanError(str(error)) from error


def _grid(given: Any) -> WavelengthGrid:
    """Bands by the centres of the first and the last and their distance, nm."""
    values = as_array(given)
    if values.shape != (3,):
        shown = f"{len(values)} values" if values.ndim == 1 and len(values) else repr(given)
        raise PlanError(
            f"bands_nm are the centres of the first and of the last band and their distance in nm, such as"
            f" (430, 660, 5); given {shown}."
        )
    first, last, step = given
    try:
        return WavelengthGrid(start_nm=first, stop_nm=last, step_nm=step)
    except ValidationError as error:
        words = "; ".join(what_is_wrong(fault) for fault in error.errors())
        shown = ", ".join(map(as_given, given))
        raise PlanError(f"bands_nm cannot be {shown}: {words}.") from error


def _region(given: Sequence[int], size_px: tuple[int, int]) -> tuple[int, int, int, int]:
    """The region, which must be a part of a picture of this width and height."""
    numbers = whole_numbers(given)
    if numbers is None or len(numbers) != 4:
        values = as_array(given)
        shown = repr(given) if values.ndim < 2 and values.size < 9 else f"{values.shape} values"
        raise PlanError(f"A region is x, y, width and height in whole pixels, given {shown}.")
    x, y, width, height = numbers
    if x < 0 or y < 0 or width < 1 or height < 1 or x + width > size_px[0] or y + height > size_px[1]:
        raise PlanError(
            f"The region x {x}, y {y}, width {width}, height {height} is not a part of the picture of"
            f" {size_px[0]} x {size_px[1]} pixels."
        )
    return x, y, width, height

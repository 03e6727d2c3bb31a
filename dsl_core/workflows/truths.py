"""What is known of the scene of a result: the truth of the twin, of the part of the picture that it is."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dsl_core.devices.base import DeviceRig
from dsl_core.devices.registry import is_built_in, open_rig
from dsl_core.errors import DecodeError
from dsl_core.evaluation.summary import Truth
from dsl_core.io.scan.origin import rig_of_notes
from dsl_core.model.attributes import plan_of, stated_band_width_nm
from dsl_core.model.result_order import lie_between_pixels, places_px, wavelengths_of
from dsl_core.model.spectral import WavelengthGrid

if TYPE_CHECKING:
    import xarray as xr


def twin_truth(rig: DeviceRig, grid: WavelengthGrid) -> Truth | None:
    """The ground truth of the twin's scene; None for a real rig."""
    return _twin_truth(rig, grid.centres_nm, grid.step_nm)


def _twin_truth(rig: DeviceRig, bands_nm: NDArray[np.float64], width_nm: float | None) -> Truth | None:
    from dsl_core.simulation.sim_devices import SimCamera

    if not isinstance(rig.camera, SimCamera):
        return None
    truth = rig.camera.world.truth_of_colours
    materials = truth.materials
    spectra = materials.over_bands(bands_nm, width_nm)
    return Truth(truth.depth_mm, truth.lit, truth.material, materials.names, spectra, materials.targets)


def truth_of(
    result: xr.Dataset, rig_name: str | None = None, options: Mapping[str, str] | None = None
) -> Truth:
    """Truth from the rig that took the scan, or the one named, of the part of the picture that a result is.

    ``options`` replace those that the rig of the scan was opened with; a rig named has no others. Raises
    `DecodeError` if there is none.
    """
    given = dict(options or {})
    noted = None if rig_name else rig_of_notes(result.attrs)
    origin = (rig_name, given) if rig_name else noted and (noted[0], noted[1] | given)
    if origin is None:
        raise DecodeError(
            "The result does not say with which rig it was captured, so there is no truth to compare with."
            " Name a twin of the scene with --truth-rig twin and --option."
        )
    # A result from elsewhere must not open whatever it names; none but the twin has a truth.
    if rig_name is None and not is_built_in(origin[0]):
        raise DecodeError(_no_truth(origin[0]))
    with open_rig(*origin) as rig:
        bands_nm = _bands_of(result)
        truth = _twin_truth(rig, bands_nm, stated_band_width_nm(result.attrs, bands_nm))
    if truth is None:
        raise DecodeError(_no_truth(origin[0]))
    return _truth_of_part(truth, result)


def _no_truth(rig_name: str) -> str:
    return (
        f"The rig {rig_name!r} has no ground truth of its scene."
        " Name a twin of it with --truth-rig twin and --option."
    )


def _bands_of(result: xr.Dataset) -> NDArray[np.float64]:
    return wavelengths_of(result) if "reflectance" in result else WavelengthGrid().centres_nm


def _truth_of_part(truth: Truth, result: xr.Dataset) -> Truth:
    """The truth where a result is in the picture; all of it where that is not known, so that sizes decide.

    Raises `DecodeError` for a result whose pixels are averages.
    """
    for axis, size in zip(("x", "y"), truth.size_px or (), strict=False):
        if axis in result.coords and result.sizes[axis] != size and lie_between_pixels(result[axis].values):
            raise DecodeError(
                f"The result's pixels are averages, with {axis} from {result[axis].values[0]:g}, and truth"
                " is known of single pixels. Evaluate the result before you average its pixels."
            )
    plan = plan_of(result.attrs)
    if plan is None or plan.camera_size_px != truth.size_px:
        return truth
    columns, rows = (places_px(result[axis].values) if axis in result.coords else None for axis in ("x", "y"))
    if columns is None or rows is None:
        return truth
    width, height = plan.camera_size_px
    is_inside = 0 <= columns.min() <= columns.max() < width and 0 <= rows.min() <= rows.max() < height
    return truth.part(columns, rows) if is_inside else truth

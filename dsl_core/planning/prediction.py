"""What a plan will reach, predicted from the model in about a second: no picture is made.

The figures are those of `evaluation.summary`, over a reference set of reflectances or over what a quick look
saw. Errors are those of the reconstruction's own estimators on the model's data (see `virtual`); times come
from latency and exposures, and from a measured model of the computation.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.errors import DecodeError, PlanError
from dsl_core.evaluation.spectral import peak_width, spectral_errors
from dsl_core.model.plan import CapturePlan, NoSpectral
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.spectra import Bands
from dsl_core.planning import references
from dsl_core.planning.computing_time import computing_seconds
from dsl_core.planning.expected import Prediction
from dsl_core.planning.samples import SamplePixels, plane_samples
from dsl_core.planning.virtual import Outcome, VirtualPixels
from dsl_core.reconstruction.scan_result import DECIDED_FROM
from dsl_core.solve.threads import one_kernel_thread

Floats = NDArray[np.float64]
#: What the linear model leaves open in the mean of many pixels, relative to reflectance: interpolation
#: between bands, tabulated profiles, depth. Of the size that noise-free scans of the twin left.
MODEL_FLOOR = 0.003
#: Spectral step of the truth behind the width of narrow peaks, nm, and samples that state it.
FINE_STEP_NM, PEAK_SAMPLES = 1.0, 4


def predict(
    rig: Rig,
    plan: CapturePlan,
    view: SamplePixels | None = None,
    *,
    grid: WavelengthGrid | None = None,
    latency_ms: float = 0.0,
    peaks: bool = True,
) -> Prediction:
    """Expected figures of a plan on a rig.

    ``view`` is by default a plane at the rig's usual depth with the classic chart's spectra; a view of a
    quick look brings its own. Columns are taken as those of a Gray code: an XOR code alone finds them worse.
    Raises `PlanError` for plans without spectral patterns or binary code, and
    patterns that do not fit.
    """
    if isinstance(plan.spectral, NoSpectral) or plan.code_count == 0:
        raise PlanError(f"The plan {plan.name!r} has no spectral patterns or no binary code to predict for.")
    grid, plan = grid or WavelengthGrid(), plan.sized(rig.camera, rig.projector)
    with one_kernel_thread():
        return _predict(rig, plan, view or plane_samples(rig), grid, latency_ms, peaks)


def _predict(
    rig: Rig,
    plan: CapturePlan,
    view: SamplePixels,
    grid: WavelengthGrid,
    latency_ms: float,
    peaks: bool,
) -> Prediction:
    pixels = VirtualPixels(rig, plan, grid, view)
    nodes = _nodes(view, pixels.bands)
    outcome, patch = _both(pixels, nodes, *pixels.signals(torch.as_tensor(nodes, dtype=torch.float32)))
    nm = grid.centres_nm
    calm, rough = (_Errors.of(each, outcome, nm) for each in (patch, outcome.mean))
    level = float(np.sqrt((outcome.truth**2).mean()))
    return Prediction(
        frames=plan.shot_count,
        spectral_frames=plan.spectral_count,
        seconds=round(plan.duration_s(latency_ms), 3),
        raw_bytes=plan.raw_bytes,
        computing_s=round(computing_seconds(plan, grid.count), 2),
        rmse=float(np.hypot(calm.by_spectrum, MODEL_FLOOR * level)),
        pixel_rmse=float(np.hypot(rough.over_all, MODEL_FLOOR * level)),
        angle_rad=calm.angle_rad,
        pixel_angle_rad=rough.angle_rad,
        delta_e=calm.delta_e,
        fwhm_nm=_width(rig, plan, grid, view) if peaks else None,
        depth_std_mm=float(np.sqrt((outcome.depth_error_mm**2).mean())),
        coverage=view.lit_share * float(outcome.lit.mean()),
        decided=float((outcome.data_share >= DECIDED_FROM).mean()),
    )


def _both(
    pixels: VirtualPixels, nodes: Floats, first: torch.Tensor, zero: torch.Tensor
) -> tuple[Outcome, Floats]:
    """Virtual pixels, and the mean spectra (bands, samples, spectra) of many of each."""
    one, other = (pixels.run(nodes, first, zero, sign) for sign in (1, -1))
    return one, (one.mean + other.mean) / 2


def _nodes(view: SamplePixels, bands: Bands) -> Floats:
    """True spectra (samples, spectra, internal bands): the view's own, or those of the chart everywhere."""
    if view.spectra is not None and view.wavelengths_nm is not None:
        rows = [np.interp(bands.centres_nm, view.wavelengths_nm, row) for row in view.spectra]
        return np.stack(rows)[:, None]
    return np.tile(references.chart().at(bands.centres_nm), (len(view.pixels), 1, 1))


@dataclass(frozen=True)
class _Errors:
    """Of spectra (bands, samples, spectra): RMSE by spectrum and over all, mean angle and CIEDE2000."""

    by_spectrum: float
    over_all: float
    angle_rad: float
    delta_e: float

    @classmethod
    def of(cls, found: Floats, outcome: Outcome, nm: Floats) -> _Errors:
        truth = outcome.truth.reshape(len(found), -1)
        errors = spectral_errors(found.reshape(len(found), -1), truth, nm)
        # Every spectrum counts alike, as every patch does, however many samples show it.
        _, group, count = np.unique(truth, axis=1, return_inverse=True, return_counts=True)
        share = 1 / (count[group.ravel()] * len(count))
        return cls(
            float((share * errors.rmse).sum()),
            float(np.sqrt((share * errors.rmse**2).sum())),
            float((share * errors.angle_rad).sum()),
            float((share * errors.delta_e).sum()),
        )


def _width(rig: Rig, plan: CapturePlan, grid: WavelengthGrid, view: SamplePixels) -> float | None:
    """Mean width of 10 nm filters without noise, from data of a fine spectral model; None if none is seen."""
    some = np.linspace(0, len(view.pixels) - 1, PEAK_SAMPLES).round().astype(int)
    part = replace(view.part(some), spectra=None)
    pixels = VirtualPixels(rig, plan, grid, part)
    fine = Bands.of(rig, WavelengthGrid(start_nm=grid.start_nm, stop_nm=grid.stop_nm, step_nm=FINE_STEP_NM))
    filters = references.peaks()
    true, nodes = (np.tile(filters.at(bands.centres_nm), (len(some), 1, 1)) for bands in (fine, pixels.bands))
    signals = pixels.signals(torch.as_tensor(true, dtype=torch.float32), fine)
    widths = []
    for spectrum in _both(pixels, nodes, *signals)[1].mean(1).T:
        try:
            widths.append(peak_width(grid.centres_nm, spectrum).fwhm_nm)
        except DecodeError:  # too faint or too wide to have a half maximum
            continue
    return float(np.mean(widths)) if widths else None

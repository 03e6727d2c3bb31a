"""All figures of one result against its truth."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import DecodeError
from dsl_core.evaluation.depth import DepthScore, depth_score
from dsl_core.evaluation.scatter import std_of_mean, std_of_rms
from dsl_core.evaluation.spectral import Peak, SpectralErrors, known_of_first, peak_width, spectral_errors
from dsl_core.evaluation.uncertainty import DECIDED_FROM, HonestyCheck, check_honesty
from dsl_core.model.result_order import known_bands, wavelengths_of, without_missing_bands

if TYPE_CHECKING:
    import xarray as xr

Floats = NDArray[np.float64]
#: Pixels this close to another material are left out of a patch: their light is mixed.
_MARGIN_PX = 3
#: Pixels of a material that enter its figures.
_MAX_PIXELS = 4000
#: Truth with a narrower peak than this has its width compared.
_PEAKED_NM = 40.0


@dataclass(frozen=True)
class Truth:
    """What is known of a scene, as plain arrays; leave out what is not known.

    ``depth_mm`` (h, w), NaN where there is none; ``material`` (h, w), index into ``names`` and ``spectra``
    (materials, bands of the result), -1 where there is none; ``lit`` (h, w); ``targets``: the materials whose
    spectra count (default all).
    """

    depth_mm: Floats | None = None
    lit: NDArray[np.bool_] | None = None
    material: NDArray[np.int32] | None = None
    names: tuple[str, ...] = ()
    spectra: Floats | None = None
    targets: tuple[int, ...] | None = None

    @property
    def size_px(self) -> tuple[int, int] | None:
        """Columns and rows of the picture; None where nothing is known of its pixels."""
        known = [each for each in (self.depth_mm, self.material, self.lit) if each is not None]
        return (known[0].shape[1], known[0].shape[0]) if known else None

    def part(self, columns_px: NDArray[np.int64], rows_px: NDArray[np.int64]) -> Truth:
        """What is known of these columns and rows of the picture; raises ``IndexError`` for others."""
        at = np.ix_(rows_px, columns_px)
        return replace(
            self,
            depth_mm=None if self.depth_mm is None else self.depth_mm[at],
            lit=None if self.lit is None else self.lit[at],
            material=None if self.material is None else self.material[at],
        )


@dataclass(frozen=True)
class PatchScore(SpectralErrors[float]):
    """Spectra of one material: errors of the mean spectrum, and the RMSE of its single pixels.

    ``truth``, ``mean``, ``std`` (scatter from pixel to pixel), ``posterior_std`` (mean, as the result states
    it) and ``data_share`` have shape (bands,); ``coverage`` is the measured share of the patch's lit pixels.
    Differences of colour are NaN where the bands of the result hold too little of one.
    """

    name: str
    pixels: int
    coverage: float
    truth: Floats
    mean: Floats
    std: Floats
    posterior_std: Floats | None
    data_share: Floats | None
    pixel_rmse: float
    pixel_angle_rad: float
    truth_peak: Peak | None
    peak: Peak | None


@dataclass(frozen=True)
class Evaluation:
    """Figures of a result; None where truth or measurement of that kind is absent.

    ``unmeasured`` names the materials that are in view and lit but have no measured pixel.
    """

    depth: DepthScore | None
    depth_calibration: HonestyCheck | None
    patches: tuple[PatchScore, ...]
    unmeasured: tuple[str, ...]
    spectral_calibration: HonestyCheck | None

    def mean(self, figure: str) -> float:
        """Mean of a figure of `PatchScore` over the patches; raises `DecodeError` when there are none."""
        return float(np.mean(self._of_patches(figure)))

    def mean_std(self, figure: str) -> float | None:
        """Standard deviation of such a mean, by its scatter over the patches; None for fewer than two."""
        return std_of_mean([getattr(patch, figure) for patch in self.patches])

    @property
    def pixel_rmse(self) -> float:
        """RMSE of single pixels: the root of the mean square over the patches, each of which counts once.

        Raises `DecodeError` when there are none.
        """
        return math.sqrt(np.mean(np.square(self._of_patches("pixel_rmse"))))

    @property
    def pixel_rmse_std(self) -> float | None:
        """Standard deviation of `pixel_rmse`, by its scatter over the patches; None for fewer than two."""
        return std_of_rms([patch.pixel_rmse**2 for patch in self.patches])

    @property
    def mean_fwhm_nm(self) -> float | None:
        """Mean measured width over the patches whose truth is a narrow peak."""
        return float(np.mean(self._widths_nm)) if self._widths_nm else None

    @property
    def fwhm_std_nm(self) -> float | None:
        """Standard deviation of `mean_fwhm_nm`, by its scatter over patches; None for fewer than two."""
        return std_of_mean(self._widths_nm)

    def _of_patches(self, figure: str) -> list[float]:
        if not self.patches and self.unmeasured:
            raise DecodeError(
                f"No pixel of {', '.join(self.unmeasured)} has all bands, so that there is no spectrum to"
                " average over. Leave out the bands that pixels lack, or do not mask single bands."
            )
        if not self.patches:
            raise DecodeError("There is no patch with a known spectrum to average over.")
        return [getattr(patch, figure) for patch in self.patches]

    @property
    def _widths_nm(self) -> list[float]:
        return [patch.peak.fwhm_nm for patch in self.patches if patch.peak]


def evaluate(result: xr.Dataset, truth: Truth) -> Evaluation:
    """Compare a result with what is known; parts without truth or measurement are left out.

    Bands that no pixel has are left out. Raises `DecodeError` when truth and result have different sizes or
    no lit pixel was measured, and `StoreError` where a band of spectra that are compared has no wavelength of
    its own.
    """
    depth, depth_calibration = _depth(result, truth)
    if truth.material is None or truth.spectra is None or "reflectance" not in result:
        return Evaluation(depth, depth_calibration, (), (), None)
    bands, known = wavelengths_of(result), known_bands(result["reflectance"].values)
    chosen = _chosen(result, truth.material, truth.lit)
    # A band that no pixel has would leave no pixel a spectrum.
    spectra, bands, result = truth.spectra[:, known], bands[known], without_missing_bands(result)
    samples = [
        _Sample.take(result, chosen & (truth.material == index), truth.names[index], spectra[index])
        for index in (range(len(truth.names)) if truth.targets is None else truth.targets)
    ]
    samples = [sample for sample in samples if sample.wanted]
    measured = [sample for sample in samples if sample.measured]
    return Evaluation(
        depth,
        depth_calibration,
        tuple(_score(sample, bands) for sample in measured),
        tuple(sample.name for sample in samples if not sample.measured),
        _spectral_calibration(measured),
    )


def _depth(result: xr.Dataset, truth: Truth) -> tuple[DepthScore | None, HonestyCheck | None]:
    if truth.depth_mm is None or "depth_mm" not in result:
        return None, None
    measured = result["depth_mm"].values
    score = depth_score(measured, truth.depth_mm, truth.lit)
    if "depth_std_mm" not in result:
        return score, None
    return score, _honesty(measured, truth.depth_mm, result["depth_std_mm"].values, truth.lit)


def interior(material: NDArray[np.int32], margin_px: int = _MARGIN_PX) -> NDArray[np.bool_]:
    """Pixels (h, w) whose neighbourhood up to ``margin_px`` is all of their own material."""
    from scipy.ndimage import maximum_filter, minimum_filter

    size = 2 * margin_px + 1
    low = minimum_filter(material, size, mode="nearest")
    return np.asarray(low == maximum_filter(material, size, mode="nearest"))


def _chosen(
    result: xr.Dataset, material: NDArray[np.int32], lit: NDArray[np.bool_] | None
) -> NDArray[np.bool_]:
    """Lit pixels away from the borders between materials."""
    size = result["reflectance"].shape[1:]
    if material.shape != size:
        raise DecodeError(
            f"The result has {size} pixels and the truth {material.shape}; render the truth for the camera"
            " that captured the scan."
        )
    chosen = interior(material) & (material >= 0)
    return chosen if lit is None else chosen & lit


@dataclass(frozen=True)
class _Sample:
    """Measured spectra (bands, n) of one material: ``measured`` of the ``wanted`` pixels have one."""

    name: str
    truth: Floats
    wanted: int
    measured: int
    reflectance: Floats
    std: Floats | None
    share: Floats | None

    @classmethod
    def take(cls, result: xr.Dataset, where: NDArray[np.bool_], name: str, truth: Floats) -> _Sample:
        wanted = np.flatnonzero(where)
        cube = result["reflectance"].values
        good = wanted[np.isfinite(cube.reshape(len(cube), -1)[:, wanted]).all(axis=0)]
        # Evenly thinned: more pixels would take memory and change no figure.
        used = good[:: -(-good.size // _MAX_PIXELS) or 1]

        def pick(variable: str) -> Floats:
            values = result[variable].values
            return np.asarray(values.reshape(len(values), -1)[:, used], np.float64)

        std = pick("reflectance_std") if "reflectance_std" in result else None
        share = pick("data_share") if "data_share" in result else None
        return cls(name, truth, wanted.size, good.size, pick("reflectance"), std, share)


def _score(sample: _Sample, bands: Floats) -> PatchScore:
    truth = sample.truth[:, None]
    mean = sample.reflectance.mean(axis=1)
    ours = spectral_errors(mean[:, None], truth, bands)
    pixels = spectral_errors(sample.reflectance, truth, bands)
    truth_peak = _narrow_peak(bands, sample.truth)
    return PatchScore(
        name=sample.name,
        pixels=sample.measured,
        coverage=sample.measured / sample.wanted,
        truth=sample.truth,
        mean=mean,
        std=sample.reflectance.std(axis=1),
        posterior_std=None if sample.std is None else np.nanmean(sample.std, axis=1, dtype=np.float64),
        data_share=None if sample.share is None else np.nanmean(sample.share, axis=1, dtype=np.float64),
        **known_of_first(ours, bands),
        pixel_rmse=float(np.sqrt(np.mean(pixels.rmse**2))),
        pixel_angle_rad=float(pixels.angle_rad.mean()),
        truth_peak=truth_peak,
        peak=_peak_of(bands, mean) if truth_peak else None,
    )


def _peak_of(bands: Floats, mean: Floats) -> Peak | None:
    """The peak of a measured spectrum; None where it is too flat to have one."""
    try:
        return peak_width(bands, mean)
    except DecodeError:
        return None


def _narrow_peak(bands: Floats, truth: Floats) -> Peak | None:
    """The peak of a true spectrum that is one narrow line."""
    if truth.max() <= 4 * np.median(truth):
        return None
    peak = peak_width(bands, truth)
    return peak if peak.fwhm_nm < _PEAKED_NM else None


def _spectral_calibration(samples: list[_Sample]) -> HonestyCheck | None:
    """Calibration over the bands that data decide, over all samples together."""
    known = [sample for sample in samples if sample.std is not None]
    if not known:
        return None
    values = np.concatenate([sample.reflectance for sample in known], axis=1)
    truth = np.concatenate([np.broadcast_to(s.truth[:, None], s.reflectance.shape) for s in known], axis=1)
    std = np.concatenate([sample.std for sample in known if sample.std is not None], axis=1)
    shares = [sample.share for sample in known if sample.share is not None]
    decided = np.concatenate(shares, axis=1) >= DECIDED_FROM if len(shares) == len(known) else None
    return _honesty(values, truth, std, decided)


def _honesty(
    values: Floats, truth: Floats, std: Floats, counted: NDArray[np.bool_] | None
) -> HonestyCheck | None:
    """What `check_honesty` finds; None where nothing can be compared."""
    try:
        return check_honesty(values, truth, std, counted)
    except DecodeError:
        return None

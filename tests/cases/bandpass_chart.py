"""A real ColorChecker under a projector through 10 nm filters, in seven exposures, against a spectrometer.

Data: github.com/bllanos/chromatic-aberration, demo_data (Boost licence), as prepared in
shared/data/colorchecker_bandpass. Run this file as ``python -m tests.cases.bandpass_chart`` for the table.

The reference is the chart's white patch, the only patch whose spectrum is used. The light falls
differently through each filter (by up to a factor of two across the chart), so each filter gets a flat
field from the white board around the chart, relative to one filter; what all filters share is left to
the one scale per patch that the comparison allows. The board lies on three sides only, hence a flat field
of second order.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from dsl_core.evaluation.spectral import spectral_errors
from dsl_core.model.rig import Sensor
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.demosaic import demosaic
from dsl_core.optics.sensor import bayer_channels
from dsl_core.reconstruction.hdr import HdrMerger, black_frame
from tests.cases.narrowband import band_means, centroid_nm, flat_field, pass_band

SHARED = Path(os.environ.get("DSL_SHARED", Path(__file__).parents[3] / "shared"))
FOLDER = SHARED / "data" / "colorchecker_bandpass"

#: Nominal wavelength in the file names -> column of the spectrometer's table.
FILTERS = {450: "442 nm", 500: "500 nm", 550: "550 nm", 600: "600 nm", 650: "650 nm", 700: "700 nm"}
EXPOSURES_MS = (25, 50, 100, 250, 500, 2000, 3916)
REFERENCE_FILTER = 550
PATCHES = 24
WHITE, NEUTRAL = 18, slice(18, 24)
#: 8 bit, black subtracted in the camera. Photons per count only weigh the exposures.
SENSOR = Sensor(bayer="GBRG", bit_depth=8, black_level_dn=0, electrons_per_dn=30, read_noise_dn=0.5)
#: Scaled-down frames average saturated with unsaturated pixels just below full scale.
SATURATION_MARGIN_DN = 15

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ChartComparison:
    """Reflectance of 24 patches at six filters, measured and true, shape (6, 24)."""

    centroids_nm: Floats
    channels: list[str]
    measured: Floats
    truth: Floats

    def errors(self) -> Floats:
        """What remains after one scale per patch, shape (6, 24)."""
        scale = spectral_errors(self.measured, self.truth, self.centroids_nm).scale
        return self.measured * scale - self.truth


def compare(with_flat_field: bool = True) -> ChartComparison:
    """Merge, flatten, average the patches, refer them to white, and integrate the true spectra."""
    labels = _read(FOLDER / "labels" / "d2_colorChecker30cm_550nm_labels.png")
    inner = _inner_labels(labels)
    merger = _merger()
    merged = {nm: merger.merge([_raw(nm, t) for t in EXPOSURES_MS]).radiance for nm in FILTERS}
    channels = {nm: _strongest_channel(radiance, inner) for nm, radiance in merged.items()}
    images = {nm: demosaic(radiance, SENSOR.bayer)[channels[nm]] for nm, radiance in merged.items()}
    board = _white_board(images[REFERENCE_FILTER], labels)
    rows = []
    for nm, radiance in merged.items():
        flat = np.ones(labels.shape)
        if with_flat_field:
            with np.errstate(divide="ignore", invalid="ignore"):
                flat = flat_field(images[nm].astype(float) / images[REFERENCE_FILTER], board)
        rows.append(_patch_values(radiance / flat, inner, channels[nm]))
    centroids, truth = _spectrometer()
    values = np.array(rows)
    measured = values / values[:, [WHITE]] * truth[:, [WHITE]]
    return ChartComparison(centroids, ["RGB"[channels[nm]] for nm in FILTERS], measured, truth)


def _read(path: Path) -> NDArray[np.uint8]:
    return np.asarray(cv2.imread(str(path), cv2.IMREAD_UNCHANGED), np.uint8)


def _raw(filter_nm: int, exposure_ms: int) -> NDArray[np.uint8]:
    pattern = f"d2_colorChecker30cm_{filter_nm}nm_{exposure_ms}ms_*.tif"
    return _read(next((FOLDER / "color_checker_raw").glob(pattern)))


def _merger() -> HdrMerger:
    blacks = [
        black_frame([_read(p) for p in sorted((FOLDER / "dark_frames").glob(f"d2_dark_{t}ms_*.tif"))], SENSOR)
        for t in EXPOSURES_MS
    ]
    return HdrMerger(
        [float(t) for t in EXPOSURES_MS], blacks, SENSOR, saturation_margin_dn=SATURATION_MARGIN_DN
    )


def _inner_labels(labels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Labels without the edges of the patches, where colours mix."""
    kernel = np.ones((9, 9), np.uint8)
    inner = np.zeros_like(labels)
    for patch in range(1, PATCHES + 1):
        inner[cv2.erode((labels == patch).astype(np.uint8), kernel) > 0] = patch
    return inner


def _patch_values(image: NDArray[np.floating], inner: NDArray[np.uint8], channel: int) -> Floats:
    """Median of each patch over the pixels that measure the channel, shape (24,)."""
    sites = bayer_channels(SENSOR.bayer, *image.shape) == channel
    return np.array([np.median(image[sites & (inner == patch)]) for patch in range(1, PATCHES + 1)])


def _strongest_channel(radiance: NDArray[np.float32], inner: NDArray[np.uint8]) -> int:
    """The channel that sees most of a filter's light sees the smallest share of light beside it."""
    return int(np.argmax([np.median(_patch_values(radiance, inner, channel)) for channel in range(3)]))


def _white_board(image: NDArray[np.floating], labels: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """The white between the dots of the board around the chart; chart and dark top edge left out."""
    chart = np.zeros_like(labels)
    outline = cv2.convexHull(np.argwhere(labels > 0)[:, ::-1].astype(np.int32))
    cv2.fillConvexPoly(chart, outline, (1,))
    outside = cv2.dilate(chart, np.ones((41, 41), np.uint8)) == 0
    outside[:30] = False
    bright = cv2.GaussianBlur(cv2.dilate(image, np.ones((15, 15), np.uint8)), (0, 0), 5)
    white = (outside & (image > 0.8 * bright)).astype(np.uint8)
    return np.asarray(cv2.erode(white, np.ones((3, 3), np.uint8)) > 0)


def _spectrometer() -> tuple[Floats, Floats]:
    """Centroids (6,) of the filters, and means (6, 24) of the chart's spectra over them."""
    path = FOLDER / "spectra_averaged.csv"
    with path.open() as file:
        names = file.readline().strip().split(",")
    table = np.genfromtxt(path, delimiter=",", skip_header=1)
    first = names.index("dark skin")
    bands = [
        pass_band(SpectralCurve.of(table[:, 0], table[:, names.index(name)])) for name in FILTERS.values()
    ]
    means = [band_means(table[:, 0], table[:, first : first + PATCHES], band) for band in bands]
    return np.array([centroid_nm(band) for band in bands]), np.array(means)


def rms(values: Floats) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def _line(name: str, values: Iterable[float]) -> str:
    return f"{name:34s}" + " ".join(f"{v:7.4f}" for v in values)


def main() -> None:
    """Print the errors per filter and overall, with and without the flat field."""
    for flat in (False, True):
        chart = compare(with_flat_field=flat)
        errors = chart.errors()
        print("with a flat field from the board" if flat else "without a flat field")
        print(_line("  filter centroid (nm)", chart.centroids_nm), " ".join(chart.channels))
        print(_line("  RMSE, one scale per patch", (rms(e) for e in errors)))
        print(
            f"  overall {rms(errors):.4f}; without the neutral patches {rms(errors[:, :WHITE]):.4f};"
            f" without any scale {rms(chart.measured - chart.truth):.4f}"
        )


if __name__ == "__main__":
    main()

"""How long the reconstruction of a plan takes, from a model that was fitted to measured ones."""

from __future__ import annotations

from dsl_core.model.plan import CapturePlan, ScanLines

#: Core seconds that a reconstruction of any picture takes: reading its rig, and asking its frames about it.
START_S = 5.0
#: Core seconds a million pixels at `BANDS` bands, of scans of a face, 222 x 145 to 890 x 580 pixels: single
#: lines, fixed and an exposure; all other sets, fixed and a pattern. Most are within a fifth of that.
LINES_S, EXPOSURE_S = 38.0, 0.03
DENSE_S, PATTERN_S = 165.0, 0.6
BANDS = 47
#: Cores of the machine that times are stated for.
CORES = 2


def computing_seconds(plan: CapturePlan, bands: int = BANDS) -> float:
    """Expected seconds of a reconstruction on a machine like the one that was measured.

    The number of bands was not varied: time is taken as proportional to it for lines, whose matrices are
    banded, and to its square elsewhere, where building full matrices takes most of the time.
    """
    megapixels = plan.camera_size_px[0] * plan.camera_size_px[1] / 1e6
    share = bands / BANDS
    if isinstance(plan.spectral, ScanLines):
        per_megapixel_s = LINES_S * share + EXPOSURE_S * plan.shot_count
    else:
        per_megapixel_s = (DENSE_S + PATTERN_S * plan.spectral_count) * share**2
    return (START_S + megapixels * per_megapixel_s) / CORES

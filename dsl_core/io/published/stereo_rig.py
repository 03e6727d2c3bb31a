"""A rig for depth from lenses and pose of another program, with its curves where they are known."""

from __future__ import annotations

import numpy as np

from dsl_core.errors import CalibrationError
from dsl_core.io.published.any_stereo import FoundStereo
from dsl_core.io.published.curves import FoundCurves
from dsl_core.io.published.stereo_words import FARTHEST, NEAREST, doubts
from dsl_core.model.rig import LEAST_BASELINE_MM, Provenance, Rgb, Rig
from dsl_core.model.spectral import SpectralCurve


def lenses_on(
    base: Rig,
    found: FoundStereo,
    source: str,
    camera_curves: FoundCurves | None = None,
    led_curves: FoundCurves | None = None,
) -> Rig:
    """A rig for depth: these lenses and pose; film and scales of ``base`` mean nothing, nor do its curves.

    Curves that are given are relative to the largest of them, and are made as large as those of ``base``.
    Raises `CalibrationError` where camera and projector are not apart.
    """
    stereo = found.stereo
    distance = float(np.linalg.norm(stereo.pose.vector_mm))
    if distance <= LEAST_BASELINE_MM:
        raise CalibrationError(f"{source}: {next(doubts(stereo))}. A rig needs the true translation, in mm.")
    given = [each.words for each in (camera_curves, led_curves) if each is not None]
    notes = f"film and scales from {base.name!r}; {'; '.join(given)}" if len(given) == 2 else (
        f"film, curves and scales from {base.name!r}: for depth alone{''.join(f'; {each}' for each in given)}"
    )  # fmt: skip
    assumed = f"; assumed: {', '.join(found.assumed)}" if found.assumed else ""
    return Rig(
        name=source,
        camera=stereo.camera,
        projector=stereo.projector,
        pose=stereo.pose,
        film=base.film,
        response=base.response if camera_curves is None else as_large_as(base.response, camera_curves.curves),
        emission=base.emission if led_curves is None else as_large_as(base.emission, led_curves.curves),
        efficiency=base.efficiency,
        white_scale=base.white_scale,
        depth_range_mm=(NEAREST * distance, FARTHEST * distance),
        provenance=Provenance(
            source=f"lenses and pose of {source}",
            notes=f"{notes}{assumed}",
        ),
    )


def as_large_as(base: Rgb, curves: Rgb) -> Rgb:
    """Curves of any scale whose largest value is that of ``base`` at their wavelengths."""
    of_base = max(one.at(curve.wavelengths_nm).max() for one, curve in zip(base, curves, strict=True))
    own = max(max(curve.values) for curve in curves)
    red, green, blue = (
        SpectralCurve.of(curve.wavelengths_nm, np.multiply(curve.values, of_base / own), base[0].unit)
        for curve in curves
    )
    return red, green, blue

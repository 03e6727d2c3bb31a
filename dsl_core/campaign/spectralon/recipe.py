"""Spectralon: emission of the LEDs, the white that all reflectance refers to, and the flat field."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dsl_core.calibration.common.plane import bulge_mm
from dsl_core.calibration.light.beyond_target import unsure_gain
from dsl_core.calibration.light.emission import measured_emission
from dsl_core.calibration.light.spectralon import (
    UniformPictures,
    match_whites,
    measure_white,
    spectralon_calibration,
)
from dsl_core.calibration.light.spectralon_figures import spectralon_figures, unevenness_of_middle
from dsl_core.campaign.common.bounds import (
    LEAST_REFLECTANCE,
    MOST_REFLECTANCE,
    Count,
    Positive,
    Reflectance,
    RelativeStd,
)
from dsl_core.campaign.common.depths import target_depth_mm
from dsl_core.campaign.common.flat_target import capture_uniform, middle, read_uniform
from dsl_core.campaign.common.recipe import Bench, Recipe, Step, naming
from dsl_core.campaign.common.white_shot import brightness, other_light, shoot_white
from dsl_core.campaign.spectralon.emission_readings import is_read, load_readings, read_emission
from dsl_core.errors import CalibrationError, DslError
from dsl_core.io.spectra.spectrum_file import read_spectrum
from dsl_core.model.calibration.spectralon import MeasuredEmission, SpectralonCalibration
from dsl_core.model.figure import Figure
from dsl_core.model.placement import Placement
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.shading import plane_shading
from dsl_core.progress import Progress

EMISSION, PICTURES = "emission", "pictures"


@dataclass(frozen=True)
class SpectralonRecipe(Recipe[SpectralonCalibration]):
    """The calibration with a Spectralon.

    ``reflectance`` is the certified reflectance of the Spectralon; ``reflectance_file`` is a text file of
    reflectance against wavelength, used instead. ``reflectance_rel_std`` is the relative deviation of either:
    no picture shows it, and all reflectances of scans contain it. ``readings`` is how many times the
    spectroradiometer reads each picture; ``emission_folder`` holds text files ``red*``, ``green*``,
    ``blue*``, ``white*``, ``black*`` from an instrument that is not connected. ``depth_mm`` is the distance
    of the target, by default two fifths into the rig's depth range.
    """

    name = "spectralon"
    title = "Spectralon"
    #: For the shading of the target.
    needs = ("geometry",)
    record_type = SpectralonCalibration

    reflectance: Reflectance = 0.99
    reflectance_file: str = ""
    # Certificates state half a percent, which is two deviations.
    reflectance_rel_std: RelativeStd = 0.0025
    readings: Count = 16
    emission_folder: str = ""
    depth_mm: Positive | None = None

    def steps(self, bench: Bench) -> tuple[Step, ...]:
        """Spectra of the LEDs, then pictures."""
        depth_mm = target_depth_mm(bench.rig, self.depth_mm)
        place = Placement(target="spectralon", film=False, options={"depth_mm": depth_mm})
        where = (
            f"Take the film off. Place the Spectralon about {depth_mm / 10:g} cm from the camera, facing"
            " it, so that it fills the picture, or its middle half at the very least."
        )
        aim = " Aim the spectroradiometer at the middle of the Spectralon."
        return (
            Step(EMISSION, "Spectra of the LEDs", where + aim, place),
            Step(PICTURES, "White, red, green and blue", where + " Keep the room dark.", place),
        )

    def look(self, bench: Bench, step: Step) -> tuple[Figure, ...]:
        """Whether the middle is bright, even and free of other light."""
        white = shoot_white(bench)
        return (
            brightness(white, bench.rig, "lens cap, aperture and projector"),
            unevenness_of_middle(white.picture, bench.rig),
            other_light(white, "target"),
        )

    def is_captured(self, bench: Bench, step: Step) -> bool:
        """Whether all spectra are read, from the folder if one is named, or the scan is complete."""
        return is_read(bench, step, self._files()) if step.key == EMISSION else bench.is_scanned(step)

    def measures_light(self, step: Step) -> bool:
        """The pictures do: of the spectra only their shapes count."""
        return step.key == PICTURES

    def acts_at_capture(self, step: Step) -> dict[str, float]:
        """How often spectra are read, as far as they do not come from files."""
        return {"readings": self.readings} if step.key == EMISSION and self._files() is None else {}

    def capture(self, bench: Bench, step: Step, progress: Progress) -> None:
        """Read spectra, or choose exposures by a test shot and capture."""
        if step.key == EMISSION:
            read_emission(bench, step, self.readings, self._files(), progress)
        else:
            capture_uniform(bench, step, 1.0, progress)

    def fit(self, bench: Bench, progress: Progress) -> SpectralonCalibration:
        """Emission, white signals and flat field from the captures."""
        spectra, pictures = self.steps(bench)
        reflectance = self._reflectance()
        with naming(spectra):
            emission = measured_emission(load_readings(bench, spectra), reflectance)
        with naming(pictures):
            return self._pictures(bench, pictures, emission, reflectance, progress)

    def is_current(self, record: Mapping[str, Any]) -> bool:
        """Whether the file of reflectance says what it said at the fit; one that is gone says nothing."""
        if not self.reflectance_file or not Path(self.reflectance_file).exists():
            return True
        try:
            return bool(record.get("reflectance") == self._reflectance().model_dump(mode="json"))
        except DslError:
            return False  # a fit says why

    def figures(self, record: SpectralonCalibration, done: Collection[str] = ()) -> tuple[Figure, ...]:
        """What was measured, against its limits."""
        return spectralon_figures(record)

    def apply(self, record: SpectralonCalibration, rig: Rig) -> Rig:
        """Emission, flat field, and responses and white scale that reproduce the white signals."""
        known = rig.model_copy(
            update={
                "emission": record.emission.curves,
                "flat_field": record.flat_field,
                "reference_rel_std": record.reflectance_rel_std,
                "white_reflectance": record.reflectance,
            }
        )
        return match_whites(known, record.white, record.reflectance)

    def _pictures(
        self,
        bench: Bench,
        step: Step,
        emission: MeasuredEmission,
        reflectance: SpectralCurve,
        progress: Progress,
    ) -> SpectralonCalibration:
        target = read_uniform(bench.scan_of(step), bench.rig, progress)
        found = target.plane(bench.rig, middle(target.lit.shape))
        uniform = UniformPictures(
            radiance=target.radiance,
            saturated=target.saturated,
            shading=plane_shading(bench.rig, found.plane),
            usable=target.lit & found.on_plane,
            sensor=bench.rig.sensor,
        )
        record = spectralon_calibration(
            reflectance, emission, uniform, measure_white(uniform), found, middle(target.lit.shape)
        )
        return record.model_copy(
            update={
                "reflectance_rel_std": self.reflectance_rel_std,
                "flat_field_unsure": unsure_gain(
                    bench.rig, found.plane, record.flat_field, record.flat_field_std
                ),
                "light_change": target.light_change(uniform.usable),
                "bulge_mm": bulge_mm(bench.rig, target.depth_mm, found),
            }
        )

    def _files(self) -> Path | None:
        return Path(self.emission_folder) if self.emission_folder else None

    def _reflectance(self) -> SpectralCurve:
        """The certified reflectance over wavelength; raises `CalibrationError`."""
        if not 0 <= self.reflectance_rel_std < 0.2:
            raise CalibrationError(
                f"The relative deviation of the Spectralon's reflectance cannot be"
                f" {self.reflectance_rel_std:g}; give a share such as 0.0025, half of what its certificate"
                " states for 95 %."
            )
        curve = SpectralCurve.of([400.0, 700.0], [self.reflectance] * 2)
        if self.reflectance_file:
            curve = read_spectrum(Path(self.reflectance_file), radiance=False)
        for nm, share in zip(curve.wavelengths_nm, curve.values, strict=True):
            if not LEAST_REFLECTANCE <= share <= MOST_REFLECTANCE:
                where = f" at {nm:g} nm ({Path(self.reflectance_file).name})" if self.reflectance_file else ""
                raise CalibrationError(
                    f"The reflectance of the Spectralon cannot be {share:g}{where}; give a share of"
                    f" {LEAST_REFLECTANCE:g} to {MOST_REFLECTANCE:g}, such as 0.99, from its certificate."
                )
        return curve

"""The self-test: are camera, projector, timing, focus and room good enough to calibrate and scan."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from dsl_core.calibration.selftest.figures import AMBIENT, selftest_figures
from dsl_core.calibration.selftest.readings import ROUNDING_DN2
from dsl_core.calibration.selftest.record import WANTED_MS, analyse
from dsl_core.campaign.common.bounds import Positive
from dsl_core.campaign.common.recipe import Bench, Recipe, Step, naming
from dsl_core.campaign.selftest.capture import ARCHIVE_NAME, SEED, SelfTestRun, load_capture, save_capture
from dsl_core.campaign.selftest.recorder import Recorder
from dsl_core.campaign.selftest.survey import survey
from dsl_core.errors import CalibrationError, DeviceError
from dsl_core.model.calibration.selftest import CameraCheck, SelfTest
from dsl_core.model.figure import Figure
from dsl_core.model.placement import Placement
from dsl_core.model.rig import Rig, Sensor
from dsl_core.progress import Progress

#: Share of the camera's pixels that the picture should light well.
_LIT_SHARE = 0.2
_STEP = Step(
    "light",
    "Self-test",
    "Take the film off, and put a white, matt, flat target (Spectralon, paper) in front of the camera so that"
    " it fills the view. Darken the room as for a scan.",
    Placement(target="spectralon", film=False),
)


@dataclass(frozen=True)
class SelfTestRecipe(Recipe[SelfTest]):
    """The self-test as a calibration; ``wanted_ms`` are the exposures that scans should use."""

    name = "selftest"
    title = "Self-test"
    keeps_frames = False
    record_type = SelfTest

    wanted_ms: tuple[Positive, ...] = WANTED_MS

    def steps(self, bench: Bench) -> tuple[Step, ...]:
        """One step, film off, on a white target."""
        return (_STEP,)

    def look(self, bench: Bench, step: Step) -> tuple[Figure, ...]:
        """Share of the picture that is well lit, and ambient light; raises what the survey raises."""
        # The next attempt number keeps the noise of a simulated camera apart from that of the captures.
        recorder = Recorder(bench.devices, attempt=1)
        try:
            seen = survey(recorder, np.random.default_rng(SEED))
        except (CalibrationError, DeviceError) as error:
            raise type(error)(f"{step.title}: {error}") from error
        return (
            Figure(
                name="well lit share of the picture",
                value=100 * seen.lit_share,
                unit="%",
                low=100 * _LIT_SHARE,
                advice="Fill the camera's view with a white target, and light all of it.",
            ),
            Figure(
                name="ambient light",
                value=100 * seen.ambient_share,
                std=100 * seen.ambient_std,
                unit="% of white",
                high=100 * (AMBIENT + 3 * seen.ambient_std),
                advice="Switch off lamps and keep daylight out.",
            ),
        )

    def is_captured(self, bench: Bench, step: Step) -> bool:
        """Whether the archive of readings exists; it is written whole."""
        return (bench.step_folder(step) / ARCHIVE_NAME).exists()

    def capture(self, bench: Bench, step: Step, progress: Progress) -> None:
        """Take all frames and keep their readings; an interrupted self-test starts again."""
        save_capture(SelfTestRun(bench.devices, progress, self.wanted_ms).capture(), bench.step_folder(step))

    def fit(self, bench: Bench, progress: Progress) -> SelfTest:
        """Analyse the readings on disk; raises `CalibrationError` that names what is wrong."""
        progress.report("self-test", 0, 1)
        with naming(_STEP):
            found = analyse(load_capture(bench.step_folder(_STEP)))
        progress.report("self-test", 1, 1)
        return found

    def figures(self, record: SelfTest, done: Collection[str] = ()) -> tuple[Figure, ...]:
        """Everything measured, against its limits."""
        return selftest_figures(record)

    def apply(self, record: SelfTest, rig: Rig) -> Rig:
        """Sensor, light by drive level and black of the projector, and the period of its colour cycle."""
        camera, projector = record.camera, record.projector
        sensor = {
            "bit_depth": camera.bit_depth,
            "black_level_dn": camera.black_level_dn.value,
            "electrons_per_dn": camera.electrons_per_dn.value,
            "read_noise_dn": _read_noise_dn(camera),
            "saturation_dn": _saturation_dn(camera, rig.sensor),
            "step_dn": camera.step_dn,
        }
        response = {
            "gamma": projector.gamma.value,
            "tone": projector.tone,
            "black_fraction": projector.black_fraction.value,
        }
        changes: dict[str, object] = {
            "sensor": rig.sensor.model_copy(update=sensor),
            "projector_response": rig.projector_response.model_copy(update=response),
        }
        if record.cycle.period_ms is not None:
            changes["frame_period_ms"] = record.cycle.period_ms.value
        return rig.model_copy(update=changes)


def _saturation_dn(camera: CameraCheck, known: Sensor) -> int | None:
    """Where values end or bend, None at the largest number of the bits; as known where nothing clipped."""
    if camera.bends:
        return int(camera.useful_dn)
    if camera.ends_dn is None:
        return known.saturation_dn
    return camera.ends_dn if camera.ends_dn < 2**camera.bit_depth - 1 else None


def _read_noise_dn(camera: CameraCheck) -> float:
    """Read noise without what coarse steps add: a sensor's step counts beside its noise."""
    coarse_dn2 = (camera.step_dn**2 - 1) * ROUNDING_DN2
    return float(max(camera.read_noise_dn.value**2 - coarse_dn2, 0.0) ** 0.5)

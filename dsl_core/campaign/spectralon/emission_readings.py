"""Spectra of the uniform pictures: read from an instrument or from files, kept in the folder of a step."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dsl_core.campaign.common.recipe import Bench, Step
from dsl_core.devices.base import DeviceRig
from dsl_core.devices.plausible import require_grid, require_light
from dsl_core.errors import CalibrationError, DslError, StoreError
from dsl_core.io.spectra.catalogue import suffixes
from dsl_core.io.spectra.spectrum_file import read_radiances
from dsl_core.model.calibration.spectralon import COLOURS, EmissionReadings, LightColour
from dsl_core.model.spectral import SpectralCurve
from dsl_core.progress import Progress

READINGS_NAME = "readings.json"
#: Drive of red, green and blue in each picture.
DRIVE: dict[LightColour, tuple[int, int, int]] = {
    "red": (255, 0, 0),
    "green": (0, 255, 0),
    "blue": (0, 0, 255),
    "white": (255, 255, 255),
    "black": (0, 0, 0),
}


def is_read(bench: Bench, step: Step, files: Path | None) -> bool:
    """Whether the spectra of all pictures are stored.

    Raises `StoreError` where they are not those of a folder of ``files``: it was named, or a file corrected,
    after they were read.
    """
    if not _is_begun(bench, step):
        return False
    kept = load_readings(bench, step)
    if set(kept.readings) != set(COLOURS):
        return False
    if files is not None and not _are_of(files, kept):
        raise StoreError(
            f"The spectra that were read are not those of the folder {files} (emission_folder). Capture the"
            f" step {step.key} again to read these."
        )
    return True


def load_readings(bench: Bench, step: Step) -> EmissionReadings:
    """The spectra of a step; raises `StoreError`."""
    return bench.kept(step, READINGS_NAME, EmissionReadings)


def read_emission(bench: Bench, step: Step, count: int, files: Path | None, progress: Progress) -> None:
    """Read all spectra and store them: ``count`` of each picture, or those of a folder of ``files``.

    What an earlier call has read stays. Raises `CalibrationError` without an instrument and files, or for a
    file that is missing or wrong.
    """
    if files is not None:
        read = EmissionReadings(source=files.name, readings=_from_files(files))
        bench.keep(step, READINGS_NAME, read)
        return
    devices = bench.devices
    if devices.spectroradiometer is None:
        raise CalibrationError(
            f"The rig {devices.name!r} has no spectroradiometer. Measure the Spectralon under red, green,"
            " blue, white and black pictures with your own, save each spectrum as text (red.csv, green.csv,"
            " ...), and name their folder in the setting emission_folder."
        )
    readings = load_readings(bench, step).readings if _is_begun(bench, step) else {}
    for done, colour in enumerate(COLOURS):
        progress.report("spectra", done, len(COLOURS))
        if colour not in readings:
            measured = _measure(devices, colour, count)
            first = next((curves[0] for curves in readings.values()), measured[0])
            for curve in measured:
                require_grid(curve, first, "The spectroradiometer")
            if colour != "black":
                before = {known: each for known, curves in readings.items() for each in curves}
                for curve in measured:
                    require_light(curve, before, colour, "The spectroradiometer")
            readings = {**readings, colour: measured}
            read = EmissionReadings(source="spectroradiometer", readings=readings)
            bench.keep(step, READINGS_NAME, read)
    progress.report("spectra", len(COLOURS), len(COLOURS))


def _are_of(files: Path, kept: EmissionReadings) -> bool:
    """Whether spectra are those of a folder; one that is gone says nothing else than when it was read."""
    if not files.is_dir():
        return kept.source == files.name
    try:
        return _from_files(files) == kept.readings
    except DslError:
        return False  # reading them says why


def _is_begun(bench: Bench, step: Step) -> bool:
    return (bench.step_folder(step) / READINGS_NAME).exists()


def _measure(devices: DeviceRig, colour: LightColour, count: int) -> tuple[SpectralCurve, ...]:
    assert devices.spectroradiometer is not None
    info = devices.projector.info
    devices.projector.show(np.full((info.height_px, info.width_px, 3), DRIVE[colour], np.uint8))
    return tuple(devices.spectroradiometer.measure() for _ in range(max(count, 1)))


def _from_files(folder: Path) -> dict[LightColour, tuple[SpectralCurve, ...]]:
    """Spectra of all files whose names begin with a colour."""
    if not folder.is_dir():
        raise CalibrationError(f"The folder of spectra {folder} does not exist. Correct emission_folder.")
    paths = sorted(path for path in folder.iterdir() if path.suffix.lower() in suffixes())
    named = {c: [path for path in paths if path.name.lower().startswith(c)] for c in COLOURS}
    missing = [colour for colour, found in named.items() if not found]
    if missing:
        raise CalibrationError(
            f"{folder} has no spectrum of {', '.join(missing)}. Name the files red*, green*, blue*, white*"
            f" and black*, with one of {', '.join(suffixes())} at the end."
        )
    return {
        colour: tuple(curve for path in found for curve in read_radiances(path))
        for colour, found in named.items()
    }

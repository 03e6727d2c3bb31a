"""Spectralon and Color Checker on twins that nobody knows: what is found is true, what is wrong is told."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from dsl_core.campaign.color_checker.recipe import ColorCheckerRecipe
from dsl_core.campaign.common.recipe import Bench, Recipe, RecordT
from dsl_core.campaign.session import CalibrationSession
from dsl_core.campaign.spectralon.emission_readings import DRIVE
from dsl_core.campaign.spectralon.recipe import SpectralonRecipe
from dsl_core.devices.base import DeviceRig
from dsl_core.errors import CalibrationError
from dsl_core.io.campaign_folder import CampaignFolder
from dsl_core.model.calibration.color_checker import ColorCheckerCalibration
from dsl_core.model.calibration.spectralon import SpectralonCalibration
from dsl_core.model.figure import failures
from dsl_core.model.frames import Frame
from dsl_core.model.placement import Placement
from dsl_core.model.rig import Rig
from dsl_core.optics.sensor import relative_gain
from dsl_core.optics.spectra import chain_response
from dsl_core.progress import NoProgress
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.random_rig import random_rig
from dsl_core.simulation.sim_devices import open_twin

SIZE = (222, 145)
NM = np.arange(400.0, 701.0)
NONE = NoProgress()


def twin(truth: int | None = 1, **options: str) -> DeviceRig:
    text = {} if truth is None else {"truth": str(truth)}
    return open_twin({"size": f"{SIZE[0]}x{SIZE[1]}", **text, **options})


@cache
def true_rig(truth: int) -> Rig:
    published = published_rig()
    return random_rig(truth, published.model_copy(update={"camera": published.camera.resized(*SIZE)}))


def known(truth: int, devices: DeviceRig) -> Rig:
    """What self-test and geometry leave open: curves, white scale, evenness."""
    true = true_rig(truth)
    assert devices.nominal is not None
    parts = ("camera", "projector", "pose", "sensor", "projector_response")
    return devices.nominal.model_copy(update={part: getattr(true, part) for part in parts})


def calibrate(recipe: Recipe[RecordT], devices: DeviceRig, rig: Rig, folder: Path) -> RecordT:
    bench = Bench(devices, folder, rig)
    for step in recipe.steps(bench):
        assert devices.place is not None
        devices.place(step.placement)
        assert not recipe.is_captured(bench, step)
        recipe.capture(bench, step, NONE)
        assert recipe.is_captured(bench, step)
    record = recipe.fit(bench, NONE)
    return recipe.record_type.model_validate_json(record.model_dump_json())


def whites(rig: Rig) -> np.ndarray:
    """Signals of white (channels, LEDs), at the mean gain of the camera."""
    return np.asarray(chain_response(rig, 0, NM).sum(-1) * relative_gain(rig).mean())


@cache
def spectralon(truth: int, folder: Path) -> tuple[Rig, Rig, SpectralonCalibration]:
    devices = twin(truth)
    start = known(truth, devices)
    record = calibrate(SpectralonRecipe(), devices, start, folder)
    assert isinstance(record, SpectralonCalibration)
    return start, SpectralonRecipe().apply(record, start), record


@pytest.mark.parametrize("truth", [1, 2])
def test_spectralon_finds_light_white_and_evenness(truth: int, module_folder: Path) -> None:
    _, rig, record = spectralon(truth, module_folder / f"spectralon-{truth}")
    true = true_rig(truth)
    assert not failures(SpectralonRecipe().figures(record))
    np.testing.assert_allclose(whites(rig).sum(1), whites(true).sum(1), rtol=6e-4)
    # Vignetting is taken out before the scatter over the image says how well white is known.
    assert rig.white_scale_rel_std < 3e-4
    np.testing.assert_allclose(whites(rig), whites(true), rtol=3e-3)
    found, truth_led = (np.stack([c.at(NM) for c in r.emission]) for r in (rig, true))
    error = found / found.sum() * truth_led.sum() - truth_led
    assert np.sqrt((error**2).mean()) < 0.0005 * truth_led.max()
    gain = relative_gain(rig) / relative_gain(true)
    assert (gain / gain.mean()).std() < 6e-4


def test_spectralon_is_applied_once_and_for_all(module_folder: Path) -> None:
    _, rig, record = spectralon(1, module_folder / "spectralon-1")
    again = SpectralonRecipe().apply(record, rig)
    assert again.white_scale == pytest.approx(rig.white_scale, rel=1e-12)
    np.testing.assert_allclose(again.response[0].values, rig.response[0].values, rtol=1e-9)


@pytest.mark.slow
def test_color_checker_refines_what_the_spectralon_left(module_folder: Path) -> None:
    _, start, _ = spectralon(1, module_folder / "spectralon-1")
    # Upside down, as a person might place it.
    devices = twin(1, chart_roll_deg="180")
    recipe = ColorCheckerRecipe()
    record = calibrate(recipe, devices, start, module_folder / "color-checker")
    assert isinstance(record, ColorCheckerCalibration)
    assert record.quarter_turns == 2
    assert len(record.patches) == 24
    assert not failures(recipe.figures(record))
    assert record.held_out < 0.7 * record.start
    assert record.held_out < 0.002
    rig, true = recipe.apply(record, start), true_rig(1)
    assert recipe.apply(record, rig) == rig
    bands = (NM >= 430) & (NM <= 660)

    def error(of: Rig) -> float:
        given, truth = (np.stack([c.at(NM) for c in r.response]) for r in (of, true))
        off = (given / given.sum() * truth.sum() - truth) / truth.max(1, keepdims=True)
        return float(np.sqrt((off[:, bands] ** 2).mean()))

    assert error(rig) < 0.5 * error(start)
    np.testing.assert_allclose(whites(rig).sum(1), whites(true).sum(1), rtol=1e-3)


def test_look_tells_a_bright_even_middle_from_a_chart() -> None:
    devices = twin(1)
    recipe = SpectralonRecipe()
    bench = Bench(devices, Path(), known(1, devices))
    assert devices.place is not None
    devices.place(Placement(target="spectralon", film=False))
    assert not failures(recipe.look(bench, recipe.steps(bench)[0]))
    devices.place(Placement(target="color-checker", film=False))
    assert [f.name for f in failures(recipe.look(bench, recipe.steps(bench)[0]))] == [
        "unevenness of the middle"
    ]


def test_an_uneven_spectralon_is_told(module_folder: Path) -> None:
    """A chart in the place of the Spectralon: its patches differ, most are far from the median."""
    devices = twin(1)
    recipe = SpectralonRecipe()
    bench = Bench(devices, module_folder / "uneven", known(1, devices))
    assert devices.place is not None
    for step in recipe.steps(bench):
        devices.place(Placement(target="color-checker", film=False))
        recipe.capture(bench, step, NONE)
    record = recipe.fit(bench, NONE)
    assert "middle filled by the Spectralon" in [f.name for f in failures(recipe.figures(record))]


def test_a_saturated_spectralon_is_told(module_folder: Path) -> None:
    start, _, _ = spectralon(1, module_folder / "spectralon-1")
    too_small = start.sensor.model_copy(update={"bit_depth": 10, "black_level_dn": 100.0})
    bright = start.model_copy(update={"sensor": too_small})
    recipe = SpectralonRecipe()
    with pytest.raises(CalibrationError, match=r"White, red, green and blue: Only \d+ pixels"):
        recipe.fit(Bench(twin(1), module_folder / "spectralon-1", bright), NONE)


def test_a_missing_chart_is_told(module_folder: Path) -> None:
    start, _, _ = spectralon(1, module_folder / "spectralon-1")
    devices = twin(1)
    recipe = ColorCheckerRecipe()
    bench = Bench(devices, module_folder / "no-chart", start)
    (step,) = recipe.steps(bench)
    assert devices.place is not None
    devices.place(Placement(target="spectralon", film=False))
    with pytest.raises(CalibrationError, match="No Color Checker was found in the test shot"):
        recipe.look(bench, step)
    recipe.capture(bench, step, NONE)
    with pytest.raises(CalibrationError, match="Color Checker: No Color Checker was found"):
        recipe.fit(bench, NONE)


def test_spectra_may_come_from_files(tmp_path: Path) -> None:
    devices, spectra = twin(1), tmp_path / "spectra"
    write_spectra(devices, spectra)
    alone = replace(devices, spectroradiometer=None)
    recipe = SpectralonRecipe(emission_folder=str(spectra))
    bench = Bench(alone, tmp_path / "spectralon", known(1, devices))
    first = recipe.steps(bench)[0]
    recipe.capture(bench, first, NONE)
    assert recipe.is_captured(bench, first)
    with pytest.raises(CalibrationError, match="has no spectroradiometer"):
        SpectralonRecipe().capture(Bench(alone, tmp_path / "b", bench.rig), first, NONE)
    (spectra / "black.csv").unlink()
    with pytest.raises(CalibrationError, match="no spectrum of black"):
        recipe.capture(bench, first, NONE)


def write_spectra(devices: DeviceRig, folder: Path, factor: float = 1.0) -> None:
    """What the twin's instrument reads under each picture, times a factor, as files."""
    assert devices.place is not None
    assert devices.spectroradiometer is not None
    devices.place(Placement(target="spectralon", film=False))
    info = devices.projector.info
    folder.mkdir(exist_ok=True)
    for colour, drive in DRIVE.items():
        devices.projector.show(np.full((info.height_px, info.width_px, 3), drive, np.uint8))
        curve = devices.spectroradiometer.measure()
        values = 1e3 * factor * np.array(curve.values)
        rows = [f"{nm:g};{v:.8g}" for nm, v in zip(curve.wavelengths_nm, values, strict=True)]
        (folder / f"{colour}.csv").write_text("\n".join(["nm;mW/(sr m2 nm)", *rows]), encoding="utf-8")


def test_files_of_spectra_named_or_corrected_after_others_were_read_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(SpectralonRecipe, "needs", ())
    devices, spectra = twin(1), tmp_path / "spectra"
    write_spectra(devices, spectra)
    campaign = CampaignFolder.begin(tmp_path / "campaign", "twin", {})

    def session(folder: Path | None) -> CalibrationSession:
        recipe = SpectralonRecipe(emission_folder=str(folder or ""))
        return CalibrationSession(recipe, devices, campaign, (recipe,))

    def state(folder: Path | None) -> str:
        return session(folder).statuses()[0].state

    first = session(None).steps[0]
    session(None).capture(first)
    assert (state(None), state(spectra)) == ("captured", "refused")
    assert "are not those of the folder" in session(spectra).statuses()[0].reason
    with pytest.raises(CalibrationError, match="does not exist"):
        session(tmp_path / "misspelt").capture(first)
    assert state(None) == "captured", "a name that is wrong cost what the instrument has read"
    session(spectra).capture(first)
    assert state(spectra) == "captured"
    assert state(tmp_path / "other") == "refused"
    write_spectra(devices, spectra, 1.1)
    assert state(spectra) == "refused"
    session(spectra).capture(first)
    assert state(spectra) == "captured"
    (spectra / "black.csv").unlink()
    assert state(spectra) == "refused"
    # Files that were moved away later are still those that were read.
    shutil.rmtree(spectra)
    assert state(spectra) == "captured"


def test_grey_standards_may_be_as_dark_as_they_are_sold() -> None:
    for share in (0.02, 0.05, 0.99):
        assert SpectralonRecipe(reflectance=share)._reflectance().at(550.0) == share
    for share in (0.0, 0.019, 1.06, 5.0):
        with pytest.raises(CalibrationError, match=rf"cannot be {share:g}; give a share of 0\.02 to 1\.05"):
            SpectralonRecipe(reflectance=share)._reflectance()


@pytest.mark.parametrize(("nm", "share"), [(400, 1.8), (400, -0.3), (550, 0.0), (700, 0.019)])
def test_a_file_of_reflectance_has_the_bounds_of_a_number(nm: int, share: float, tmp_path: Path) -> None:
    file, shares = tmp_path / "white.csv", dict.fromkeys(range(400, 701, 10), 0.02) | {500: 1.05}
    recipe = SpectralonRecipe(reflectance_file=str(file))
    write_shares(file, shares)
    assert recipe._reflectance().values == tuple(shares.values())
    write_shares(file, shares | {nm: share})
    with pytest.raises(
        CalibrationError, match=rf"cannot be {share:g} at {nm} nm \(white\.csv\); give a share"
    ):
        recipe._reflectance()


def write_shares(file: Path, shares: dict[int, float]) -> None:
    file.write_text("\n".join(f"{nm},{share}" for nm, share in shares.items()), encoding="utf-8")


def test_a_fit_is_current_while_its_file_of_reflectance_says_the_same(tmp_path: Path) -> None:
    file = tmp_path / "white.csv"
    recipe = SpectralonRecipe(reflectance_file=str(file))
    write_shares(file, dict.fromkeys(range(400, 701, 10), 1 / 3))
    record = json.loads(json.dumps({"reflectance": recipe._reflectance().model_dump(mode="json")}))
    assert recipe.is_current(record)
    # Corrected under its name, corrected wrongly, gone.
    for share, current in ((0.8, False), (1.8, False), (None, True)):
        if share is None:
            file.unlink()
        else:
            write_shares(file, dict.fromkeys(range(400, 701, 10), share))
        assert recipe.is_current(record) is current
    assert SpectralonRecipe().is_current(record)


def test_an_impossible_reflectance_and_chart_are_told(module_folder: Path) -> None:
    start, _, _ = spectralon(1, module_folder / "spectralon-1")
    bench = Bench(twin(1), module_folder / "spectralon-1", start)
    with pytest.raises(CalibrationError, match="cannot be 99"):
        SpectralonRecipe(reflectance=99.0).fit(bench, NONE)
    with pytest.raises(CalibrationError, match="choose BabelColor Average"):
        ColorCheckerRecipe(chart="SG").steps(bench)


def with_lamp(devices: DeviceRig, after: int, dn: int) -> None:
    """Let a lamp add light to all pictures from a shot on."""
    camera = devices.camera
    prepare, snap, shots = camera.prepare, camera.snap, [0]

    def prepared(shot_index: int, attempt: int = 0) -> None:
        shots[0] = shot_index
        prepare(shot_index, attempt)

    def lit(timeout_ms: float = 5000.0) -> Frame:
        frame = snap(timeout_ms)
        # Test shots are numbered far above those of a scan.
        return replace(frame, pixels=frame.pixels + np.uint16(dn * (after <= shots[0] < 1_000_000)))

    camera.prepare, camera.snap = prepared, lit  # type: ignore[method-assign]


@pytest.mark.parametrize("after", [1_000_000, 26])
def test_a_lamp_that_comes_on_between_the_pictures_is_told(after: int, tmp_path: Path) -> None:
    devices = open_twin({"size": "64x42", "truth": "1"})
    with_lamp(devices, after, 15)
    recipe = SpectralonRecipe()
    assert devices.nominal is not None
    record = calibrate(recipe, devices, devices.nominal, tmp_path)
    bad = [f.name for f in failures(recipe.figures(record))]
    assert ("change of ambient light during the pictures" in bad) is (after < 1_000_000)


def test_what_is_not_known_of_the_spectralon_is_part_of_every_reflectance(module_folder: Path) -> None:
    start, rig, _ = spectralon(1, module_folder / "spectralon-1")
    assert rig.reference_rel_std == SpectralonRecipe().reflectance_rel_std
    assert rig.white_reflectance is not None
    assert set(rig.white_reflectance.values) == {SpectralonRecipe().reflectance}
    with pytest.raises(CalibrationError, match="cannot be 2; give a share such as"):
        SpectralonRecipe(reflectance_rel_std=2.0).fit(
            Bench(twin(1), module_folder / "spectralon-1", start), NONE
        )


def test_a_color_checker_is_refused_for_a_monochrome_camera_before_anything_is_captured(
    tmp_path: Path,
) -> None:
    rig = published_rig()
    mono = rig.model_copy(update={"sensor": rig.sensor.model_copy(update={"bayer": "MONO"})})
    bench, recipe = Bench(twin(), tmp_path, mono), ColorCheckerRecipe()
    (step,) = recipe.steps(bench)
    with pytest.raises(CalibrationError, match=r"camera is monochrome.*Leave this calibration out"):
        recipe.look(bench, step)
    with pytest.raises(CalibrationError, match=r"camera is monochrome.*Leave this calibration out"):
        recipe.capture(bench, step, NONE)
    assert not recipe.is_captured(bench, step)

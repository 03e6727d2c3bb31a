"""The self-test finds what is true of a rig, says what is wrong with a bad one, and fits from disk alone."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dsl_core.calibration.selftest.record import analyse
from dsl_core.campaign.common.recipe import Bench
from dsl_core.campaign.recipes import load_recipe
from dsl_core.campaign.selftest.capture import ARCHIVE_NAME, SelfTestRun, load_capture, save_capture
from dsl_core.campaign.selftest.recipe import SelfTestRecipe
from dsl_core.devices.base import DeviceRig
from dsl_core.errors import CalibrationError, Cancelled, DeviceError, StoreError
from dsl_core.model.calibration.selftest import Measured, SelfTest
from dsl_core.model.figure import Figure, failures
from dsl_core.progress import CallbackProgress, CancelToken, NoProgress, Progress
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.sim_devices import open_twin
from tests.cases.faults import FaultPlan, with_faults
from tests.cases.light_rig import LightWorld, light_rig

RECIPE = SelfTestRecipe()


def bench(devices: DeviceRig, folder: Path) -> Bench:
    return Bench(devices, folder, published_rig())


def score(measured: Measured, truth: float) -> float:
    return (measured.value - truth) / measured.std


def failed(figures: tuple[Figure, ...]) -> list[str]:
    return [figure.name.split(",")[0] for figure in failures(figures)]


def run_selftest(
    devices: DeviceRig, progress: Progress | None = None, recipe: SelfTestRecipe | None = None
) -> tuple[SelfTest, tuple[Figure, ...]]:
    """The self-test alone, on the target that is in place: what was found, and its figures."""
    recipe = recipe or SelfTestRecipe()
    found = analyse(SelfTestRun(devices, progress or NoProgress(), recipe.wanted_ms).capture())
    return found, recipe.figures(found)


@pytest.fixture(scope="module")
def found() -> SelfTest:
    return run_selftest(light_rig(LightWorld(cycle_hz=60.0, jitter_ms=0.5)))[0]


def test_all_is_found_within_its_uncertainty(found: SelfTest) -> None:
    camera, projector = found.camera, found.projector
    scores = {
        "black level": score(camera.black_level_dn, 260.0),
        "intercept": score(camera.intercept_dn, 260.0),
        "electrons per DN": score(camera.electrons_per_dn, 10.0),
        "read noise": score(camera.read_noise_dn, 1.0),
        "gamma": score(projector.gamma, 2.2),
        "black": score(projector.black_fraction, 0.0005),
    }
    assert {name: z for name, z in scores.items() if abs(z) > 3.5} == {}
    assert camera.black_level_dn.std < 0.03
    assert camera.electrons_per_dn.std < 0.1
    assert camera.read_noise_dn.std < 0.03
    assert projector.gamma.std < 0.001
    assert found.latency.blocking_ms.value == pytest.approx(30.0, abs=0.5)
    assert found.frames > 400


def test_a_good_rig_passes_and_its_rig_is_updated(found: SelfTest) -> None:
    assert failed(RECIPE.figures(found)) == []
    rig = RECIPE.apply(found, published_rig())
    assert rig.sensor.black_level_dn == found.camera.black_level_dn.value
    assert rig.projector_response.gamma == pytest.approx(2.2, abs=0.003)
    assert rig.projector_response.halo_decay_px == published_rig().projector_response.halo_decay_px
    assert rig.frame_period_ms == pytest.approx(1000 / 60, rel=1e-3)
    assert SelfTest.model_validate_json(found.model_dump_json()) == found


def test_advised_exposures_remove_the_beat(found: SelfTest) -> None:
    at = {round(beat.exposure_ms, 1): beat for beat in found.cycle.beats}
    assert sorted(at) == [160.0, 166.7, 320.0, 333.3]
    assert at[160.0].ratio_percent.value > 2.0
    assert at[320.0].ratio_percent.value > 0.5
    assert at[166.7].ratio_percent.value < 0.1
    assert at[333.3].ratio_percent.value < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("hz", [50, 60, 120])
def test_the_twins_cycle_is_found_and_its_beat_removed(hz: int) -> None:
    rig = open_twin({"scene": "plane", "film": "off", "size": "160x104", "led_cycle_hz": str(hz)})
    found, figures = run_selftest(replace(rig, place=None))
    assert failed(figures) == []
    assert found.cycle.period_ms is not None
    assert found.cycle.period_ms.value == pytest.approx(1000 / hz, rel=1e-3)
    assert found.cycle.shortest_ms == pytest.approx(1000 / hz, rel=1e-3)
    advised = [
        b for b in found.cycle.beats if any(abs(b.exposure_ms - a) < 1e-6 for a in found.cycle.advised_ms)
    ]
    assert len(advised) == 2
    assert max(beat.ratio_percent.value for beat in advised) < 0.15
    assert rig.calibration is not None
    assert abs(score(found.projector.gamma, rig.calibration.projector_response.gamma)) < 4
    assert found.latency.blocking_ms.value == pytest.approx(50.0, abs=1.5)


@pytest.mark.slow
def test_without_time_stamps_the_spread_finds_the_cycle() -> None:
    found, figures = run_selftest(light_rig(LightWorld(cycle_hz=60.0, stamps=False)))
    assert found.cycle.method == "spread"
    assert found.cycle.period_ms is not None
    assert found.cycle.period_ms.value == pytest.approx(1000 / 60, rel=5e-3)
    assert failed(figures) == []


@pytest.mark.slow
def test_steady_light_has_no_cycle_and_keeps_the_exposures_wanted() -> None:
    recipe = SelfTestRecipe(wanted_ms=(100.0,))
    found, figures = run_selftest(light_rig(LightWorld()), recipe=recipe)
    assert found.cycle.period_ms is None
    assert found.cycle.modulation.value < 0.01
    assert found.cycle.advised_ms == (100.0,)
    assert recipe.apply(found, published_rig()).frame_period_ms == published_rig().frame_period_ms
    assert failed(figures) == []


@pytest.mark.slow
def test_a_projector_without_a_power_law_passes_and_is_kept_with_its_curve() -> None:
    found, figures = run_selftest(light_rig(LightWorld(srgb=True)))
    assert failed(figures) == []
    by_name = {figure.name: figure for figure in figures}
    assert by_name["light by drive level, farthest from a power law"].value > 15
    assert "ramps, rms distance from the measured curve" in by_name
    level = np.array([26, 51, 102, 204, 255]) / 255
    light = ((level + 0.055) / 1.055) ** 2.4
    response = RECIPE.apply(found, published_rig()).projector_response
    assert response.light(level) == pytest.approx(light, rel=3e-3)
    # A self-test on another projector takes the curve away again.
    usual, _ = run_selftest(light_rig(LightWorld()))
    assert RECIPE.apply(usual, published_rig()).projector_response.tone is None


@pytest.mark.slow
@pytest.mark.parametrize(
    ("world", "names"),
    [
        (LightWorld(bend=0.05), ["linearity"]),
        (LightWorld(clip_dn=3000.0), ["saturation"]),
        (LightWorld(hot=40), ["hot pixels"]),
        (LightWorld(late_ms=37.0), ["latency not waited for"]),
        (LightWorld(ambient=5.0), ["light with the projector black"]),
        (LightWorld(gamma=(2.2, 2.3, 2.2)), ["gamma", "ramps"]),
        (LightWorld(drop=230), ["gamma", "ramps", "ramps"]),
    ],
    ids=["bent", "clipped", "hot", "late", "ambient", "gamma", "falling"],
)
def test_what_is_wrong_fails_its_own_figure(world: LightWorld, names: list[str]) -> None:
    found, figures = run_selftest(light_rig(world))
    assert failed(figures) == names
    assert all(figure.advice for figure in failures(figures))
    # Whatever else is wrong, the noise of the camera is still measured.
    assert found.camera.electrons_per_dn.value == pytest.approx(10.0, rel=0.02)


@pytest.mark.parametrize(
    ("world", "name"),
    [
        (LightWorld(drift_dn=0.05), "black level, change during the test"),
        (LightWorld(longer_ms=0.5), "exposure, longer than stated by"),
        (LightWorld(filtered=True), "noise that neighbouring pixels share"),
        (LightWorld(bands=0.02), "noise that neighbouring pixels share"),
        (LightWorld(fades=0.5), "noise that frames one after the other share"),
    ],
    ids=["black drifts", "exposure", "filter", "flicker by rows", "noise reduction in time"],
)
def test_a_camera_whose_values_are_not_raw_is_not_accepted(world: LightWorld, name: str) -> None:
    _, figures = run_selftest(light_rig(world))
    wrong = failures(figures)
    assert name in [figure.name for figure in wrong]
    assert all(figure.advice for figure in wrong)


def test_raw_values_share_no_noise_and_keep_black_and_exposure(found: SelfTest) -> None:
    camera = found.camera
    measured = (
        camera.black_change_dn,
        camera.exposure_offset_ms,
        camera.shared_by_pixels,
        camera.shared_by_frames,
    )
    for each in measured:
        assert each is not None
        assert abs(each.value) < 4 * each.std


def test_a_sensor_with_noise_of_its_rows_is_accepted() -> None:
    found, figures = run_selftest(light_rig(LightWorld(row_noise_dn=4.0)))
    assert "noise that neighbouring pixels share" not in [figure.name for figure in failures(figures)]
    assert found.camera.electrons_per_dn.value == pytest.approx(10.0, rel=0.05)


def test_archives_of_before_say_nothing_of_noise_that_is_shared(tmp_path: Path) -> None:
    save_capture(SelfTestRun(light_rig(LightWorld()), NoProgress(), (100.0,)).capture(), tmp_path)
    with np.load(tmp_path / ARCHIVE_NAME) as stored:
        kept = {name: stored[name] for name in stored.files}
    about = json.loads(str(kept["about"]))
    about["parts"].remove("black again")
    later = ("pair_covariance_dn2", "second_variance_dn2")
    kept = {name: values for name, values in kept.items() if name.split("/")[-1] not in later}
    np.savez_compressed(tmp_path / ARCHIVE_NAME, **(kept | {"about": np.array(json.dumps(about))}))
    found = analyse(load_capture(tmp_path))
    camera = found.camera
    assert (camera.black_change_dn, camera.shared_by_pixels, camera.shared_by_frames) == (None, None, None)
    assert failed(RECIPE.figures(found)) == []


def test_a_steep_gamma_within_limits_is_no_ambient_light() -> None:
    found, figures = run_selftest(light_rig(LightWorld(gamma=(3.1, 3.1, 3.1))))
    assert failed(figures) == []
    assert found.projector.gamma.value == pytest.approx(3.1, abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(("step_dn", "bits"), [(4, 0), (16, 8)])
def test_values_of_fewer_bits_are_named_before_what_they_upset(
    tmp_path: Path, step_dn: int, bits: int
) -> None:
    run = SelfTestRun(light_rig(LightWorld(step_dn=step_dn)), NoProgress(), SelfTestRecipe().wanted_ms)
    save_capture(run.capture(), tmp_path)
    figures = RECIPE.figures(analyse(load_capture(tmp_path)))
    assert figures[0].name == "distance of neighbouring values"
    assert figures[0].value == step_dn
    assert failed(figures)[:1] == (["distance of neighbouring values"] if bits else [])
    assert not bits or f"gives values of {bits} bits as ones of 12" in figures[0].advice


@pytest.mark.parametrize(
    ("world", "kind", "message"),
    [
        (LightWorld(brightness=0.0), CalibrationError, "picture is dark"),
        (
            LightWorld(connected=False, ambient=20.0),
            DeviceError,
            "white and black of the projector look the same",
        ),
        (
            LightWorld(brightness=3000.0),
            CalibrationError,
            r"White is saturated at the shortest exposure \(0.02 ms\)",
        ),
        (LightWorld(ambient=1e6), CalibrationError, "although the projector shows black"),
        (LightWorld(ambient=400.0), CalibrationError, "ambient light"),
        (LightWorld(ignores_exposure=True, brightness=0.1), DeviceError, "ignores the requested exposure"),
        (LightWorld(stale=True), DeviceError, "stale frames"),
        (LightWorld(late_ms=600.0), DeviceError, "A new picture is not always visible 400 ms"),
        (LightWorld(bits=16), DeviceError, "saturates at 4095 DN, and not at 65535 DN as its 16 bits say"),
    ],
    ids=["dark", "unplugged", "bright", "black saturated", "ambient", "exposure", "stale", "slow", "bits"],
)
def test_hopeless_rigs_are_refused_with_what_to_do(
    world: LightWorld, kind: type[Exception], message: str
) -> None:
    with pytest.raises(kind, match=f"Self-test, .*{message}"):
        run_selftest(light_rig(world))


def test_a_mosaic_that_begins_with_another_colour_is_refused() -> None:
    with pytest.raises(CalibrationError, match="should have other colours in the camera's mosaic"):
        run_selftest(light_rig(LightWorld(mosaic_off=1)))


def test_lost_frames_are_taken_again_and_a_dead_camera_is_named() -> None:
    rig = open_twin({"scene": "plane", "film": "off", "size": "96x64"})
    found, _ = run_selftest(replace(with_faults(rig, FaultPlan(seed=1, lost=0.02)), place=None))
    assert found.camera.black_level_dn.value == pytest.approx(260.0, abs=0.1)
    with pytest.raises(DeviceError, match=r"Self-test, colour cycle: .*does not answer"):
        run_selftest(replace(with_faults(rig, FaultPlan(camera_gone_at=160)), place=None))


@pytest.mark.slow
def test_captures_survive_on_disk_and_fit_needs_no_devices(tmp_path: Path, found: SelfTest) -> None:
    here = bench(light_rig(LightWorld(cycle_hz=60.0, jitter_ms=0.5)), tmp_path)
    (step,) = RECIPE.steps(here)
    assert not RECIPE.is_captured(here, step)
    RECIPE.capture(here, step, NoProgress())
    assert RECIPE.is_captured(here, step)
    assert [path.name for path in (tmp_path / step.key).iterdir()] == [ARCHIVE_NAME]
    again = RECIPE.fit(bench(light_rig(LightWorld(connected=False)), tmp_path), NoProgress())
    # The clock of the computer is no part of what is simulated.
    assert again.model_dump(exclude={"latency"}) == found.model_dump(exclude={"latency"})


def test_an_archive_that_claims_to_be_encrypted_is_damaged(tmp_path: Path) -> None:
    path = tmp_path / ARCHIVE_NAME
    np.savez_compressed(path, about=np.array("{}"))
    content = bytearray(path.read_bytes())
    # The first flag of the file's own header, and of the archive's list of files.
    for header, flags in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        content[content.index(header) + flags] |= 1
    path.write_bytes(content)
    with pytest.raises(StoreError, match=r"encrypted.*Capture the self-test again"):
        load_capture(tmp_path)


def test_an_interrupted_self_test_leaves_nothing_behind(tmp_path: Path) -> None:
    token = CancelToken()
    here = bench(light_rig(LightWorld()), tmp_path)
    (step,) = RECIPE.steps(here)

    def stop(stage: str, done: int, total: int) -> None:
        if done == 2:
            token.cancel()

    with pytest.raises(Cancelled):
        RECIPE.capture(here, step, CallbackProgress(stop, token))
    assert not RECIPE.is_captured(here, step)
    with pytest.raises(StoreError, match="Capture the self-test again"):
        RECIPE.fit(here, NoProgress())
    (tmp_path / step.key).mkdir()
    (tmp_path / step.key / ARCHIVE_NAME).write_bytes(b"PK\x03\x04 broken")
    with pytest.raises(StoreError, match="damaged"):
        RECIPE.fit(here, NoProgress())


def test_a_look_says_whether_the_target_is_right(tmp_path: Path) -> None:
    here = bench(light_rig(LightWorld()), tmp_path)
    (step,) = RECIPE.steps(here)
    assert failed(RECIPE.look(here, step)) == []
    bright = bench(light_rig(LightWorld(ambient=20.0)), tmp_path)
    assert failed(RECIPE.look(bright, step)) == ["ambient light"]
    with pytest.raises(CalibrationError, match=r"Self-test: .*lens cap"):
        RECIPE.look(bench(light_rig(LightWorld(brightness=0.0)), tmp_path), step)
    assert list(tmp_path.iterdir()) == []


def test_the_recipe_is_found_by_its_name() -> None:
    recipe = load_recipe("selftest", {"wanted_ms": "100,200"})
    assert isinstance(recipe, SelfTestRecipe)
    assert np.allclose(recipe.wanted_ms, (100.0, 200.0))
    assert recipe.needs == ()

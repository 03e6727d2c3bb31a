from __future__ import annotations

import numpy as np
import pytest

from dsl_core.devices.base import DeviceRig
from dsl_core.errors import DeviceError, PlanError
from dsl_core.model.placement import Placement
from dsl_core.patterns.trial_pictures import trial_picture
from dsl_core.simulation.bandpass_filters import LABELS_NM, true_transmission
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.random_rig import random_rig
from dsl_core.simulation.rendering.renderer import Renderer
from dsl_core.simulation.sim_devices import SimCamera, open_twin
from dsl_core.simulation.world import World

PLANE = Placement(target="spectralon", options={"depth_mm": 650.0})


def twin(**options: str) -> tuple[DeviceRig, World]:
    rig = open_twin({"size": "89x58", "noise": "off", **options})
    assert isinstance(rig.camera, SimCamera)
    assert rig.place is not None
    return rig, rig.camera.world


def place(rig: DeviceRig, placement: Placement) -> None:
    assert rig.place is not None
    rig.place(placement)


def shine(rig: DeviceRig, exposure_ms: float = 500 / 3) -> np.ndarray:
    rig.projector.show(trial_picture("white", (640, 360), 0.5))
    rig.camera.configure(exposure_ms)
    return rig.camera.snap().pixels.astype(float) - 260


def test_targets_stand_where_they_are_asked() -> None:
    rig, world = twin()
    place(rig, PLANE)
    assert world.truth.depth_mm == pytest.approx(650.0)
    place(rig, Placement(target="board", options={"depth_mm": 720.0, "roll_deg": 20.0}))
    assert "board" in world.scene_at(720.0).name
    place(rig, Placement(target="nothing"))
    assert shine(rig).max() < 5


def test_the_stage_moves_a_diffuser_that_was_placed() -> None:
    rig, world = twin()
    place(rig, PLANE)
    assert rig.stage is not None
    rig.stage.move_to(800.0)
    assert world.truth.depth_mm == pytest.approx(800.0)
    place(rig, PLANE)
    assert world.truth.depth_mm == pytest.approx(650.0)


def test_the_stage_moves_a_board_that_was_placed() -> None:
    rig, world = twin()
    place(rig, Placement(target="board", options={"depth_mm": 720.0}))
    near = world.truth.depth_mm.min()
    assert rig.stage is not None
    assert rig.stage.position_mm == 720.0
    rig.stage.move_to(800.0)
    assert near == pytest.approx(720.0)
    assert world.truth.depth_mm.min() == pytest.approx(800.0)


def test_a_depth_that_is_no_number_is_told() -> None:
    rig, _ = twin()
    with pytest.raises(PlanError, match="depth_mm must be a number"):
        place(rig, PLANE.model_copy(update={"options": {"depth_mm": "near"}}))


def test_a_bowed_diffuser_leans_as_asked() -> None:
    leaning = Placement(target="spectralon", options={"tilt_y_deg": 20.0, "reflectance": 0.5})
    depths = {}
    for bow in ("0", "2"):
        rig, world = twin(bow_mm=bow)
        place(rig, leaning)
        depths[bow] = world.truth.depth_mm
        assert world.truth.materials.reflectance.max() == 0.5
    assert np.ptp(depths["0"]) > 60
    assert 1 < np.abs(depths["2"] - depths["0"]).max() < 8
    assert np.abs(depths["2"] - depths["0"]).min() < 0.05


def test_a_filter_passes_its_band_only() -> None:
    rig, _ = twin()
    place(rig, PLANE)
    bare = shine(rig)
    signals = {}
    for label in (450.0, 640.0):
        place(rig, Placement(filter_nm=label))
        signals[label] = shine(rig)
    green, red, blue = (0, 1), (0, 0), (1, 1)
    assert signals[450.0][blue] > 5 * signals[450.0][red]
    assert signals[640.0][red] > 5 * signals[640.0][blue]
    assert signals[450.0][green] < bare[green]
    place(rig, Placement())
    assert np.array_equal(shine(rig), bare)


def test_a_view_through_a_filter_equals_one_made_for_it() -> None:
    _, world = twin(scene="plane")
    transmission = true_transmission(540.0)
    nm = np.arange(390.0, 711.0)
    response = tuple(
        type(curve).of(nm, curve.at(nm) * transmission.at(nm)) for curve in published_rig().response
    )
    made = Renderer(world.rig.model_copy(update={"response": response}), world.truth)
    pattern = np.zeros((360, 640, 3), np.uint8)
    pattern[:, 300:305] = 204
    seen = world.renderer.through(transmission).expected(pattern)
    # The light of a dark projector is summed over slices, which are narrower behind a filter.
    assert seen == pytest.approx(made.expected(pattern), rel=2e-3, abs=1e-4 * float(seen.max()))


def test_an_unknown_filter_is_told() -> None:
    rig, _ = twin()
    with pytest.raises(DeviceError, match="none of 435 nm"):
        place(rig, Placement(filter_nm=435.0))


def test_labels_are_not_the_truth_but_traces_are_near_it() -> None:
    rig, _ = twin(truth="3")
    assert sorted(rig.filters) == list(LABELS_NM)
    off = []
    for label, trace in rig.filters.items():
        nm, measured = np.array(trace.wavelengths_nm), np.array(trace.values)
        true = np.array(true_transmission(label, 3).values)
        assert np.abs(measured - true).max() < 0.01
        off.append(float((nm * measured).sum() / measured.sum()) - label)
    assert 0.5 < np.std(off) < 2


def test_noise_differs_between_placements_and_repeats_exactly() -> None:
    frames = {}
    for key in ("a", "b"):
        rig, _ = twin(noise="on", scene="plane")
        for placement in (PLANE, Placement(filter_nm=540.0)):
            place(rig, placement)
            rig.projector.show(trial_picture("black", (640, 360)))
            rig.camera.prepare(5)
            frames[key, placement.filter_nm] = rig.camera.snap().pixels
    assert np.array_equal(frames["a", None], frames["b", None])
    assert not np.array_equal(frames["a", None], frames["a", 540.0])


def test_looking_twice_without_a_shot_gives_other_noise() -> None:
    rig, _ = twin(noise="on", scene="plane")
    first, second = rig.camera.snap().pixels, rig.camera.snap().pixels
    assert not np.array_equal(first, second)


def test_a_drawn_rig_is_unknown_and_repeatable() -> None:
    rig, world = twin(truth="4")
    assert rig.calibration is None
    assert rig.nominal is not None
    # What is true leaves nothing open in its columns.
    assert world.rig == random_rig(4, rig.nominal).model_copy(update={"column_std_px": 0.0})
    assert world.rig != random_rig(5, rig.nominal)
    assert 470 <= world.rig.film.lines_per_mm <= 510
    ratio = world.rig.response[1].at(550) / rig.nominal.response[1].at(550)
    assert 0.8 < float(ratio) < 1.2


@pytest.mark.parametrize(
    ("mishap", "value"), [("stage_scale", "1.1"), ("bow_mm", "2"), ("filter_tilt_deg", "20")]
)
def test_mishaps_happen(mishap: str, value: str) -> None:
    good, bad = twin(scene="plane"), twin(scene="plane", **{mishap: value})
    for rig, _ in (good, bad):
        place(rig, Placement(target="spectralon", filter_nm=540.0, options={"depth_mm": 600.0}))
    if mishap == "filter_tilt_deg":
        assert not np.allclose(shine(good[0]), shine(bad[0]), rtol=0.02)
    else:
        assert np.abs(good[1].truth.depth_mm - bad[1].truth.depth_mm).max() > 1


def test_all_filters_can_pass_longer_wavelengths_than_measured() -> None:
    rig, world = twin(filter_off_nm="6")
    place(rig, PLANE.model_copy(update={"filter_nm": 540.0}))
    inserted, usual = world.setup.filter, true_transmission(540.0)
    assert inserted is not None
    nm = np.arange(450.0, 640.0)
    assert inserted.at(nm + 6) == pytest.approx(usual.at(nm), abs=1e-9)
    assert rig.filters == twin()[0].filters, "what a spectrometer said of them"


def test_a_wrong_filter_is_in_the_beam() -> None:
    wrong, right = twin(wrong_filter_nm="640"), twin()
    place(wrong[0], PLANE.model_copy(update={"filter_nm": 450.0}))
    place(right[0], PLANE.model_copy(update={"filter_nm": 640.0}))
    assert np.array_equal(shine(wrong[0]), shine(right[0]))


def test_a_chart_can_hang_upside_down() -> None:
    rig, world = twin(chart_roll_deg="180")
    place(rig, Placement(target="color-checker"))
    turned = world.truth.material
    place(rig, Placement(target="color-checker", options={"roll_deg": 180.0}))
    upright = world.truth.material
    assert world.truth.materials.names[upright[14, 22]] == world.truth.materials.names[turned[43, 66]]


@pytest.mark.slow
def test_a_board_can_be_elsewhere_larger_or_missing() -> None:
    asked = Placement(target="board", film=False, options={"square_mm": 20.0, "x_mm": 6.0, "depth_mm": 700.0})
    worlds = {}
    for mishap, value in (("size", "222x145"), ("board_shift_mm", "40"), ("print_scale", "1.1")):
        rig, worlds[mishap] = twin(**{"size": "222x145", mishap: value})
        place(rig, asked)
    paper = {mishap: world.truth.material < 2 for mishap, world in worlds.items()}
    columns = {mishap: np.flatnonzero(seen.any(0)) for mishap, seen in paper.items()}
    moved_px = worlds["size"].rig.camera.fx_px * 40 / 700
    assert columns["board_shift_mm"][0] - columns["size"][0] == pytest.approx(moved_px, abs=1.5)
    # The margin around the squares is not printed.
    assert paper["print_scale"].sum() == pytest.approx(paper["size"].sum() * 1.18, rel=0.03)
    rig, world = twin(target_missing="on")
    place(rig, asked)
    assert world.truth.materials.names == ("diffuser",)


def test_light_can_be_brighter_or_dimmer() -> None:
    dim, right = (shine(twin(brightness=value)[0], 20.0).mean() for value in ("0.5", "1"))
    assert dim == pytest.approx(0.5 * right, rel=0.02)


def test_defocus_softens_what_is_seen() -> None:
    rows = {}
    for defocus in ("0", "3"):
        rig, world = twin(defocus_px=defocus)
        rig.projector.show(trial_picture("white", (640, 360)))
        rows[defocus] = np.abs(np.diff(world.rate(), axis=0)[:, ::2]).max()
    assert rows["3"] < 0.5 * rows["0"]


def test_a_lens_out_of_focus_mixes_no_colours() -> None:
    """White fades slowly over a plane: blurred, each colour of the mosaic has what it had."""
    seen = {}
    for defocus in ("0", "3"):
        rig, world = twin(defocus_px=defocus, scene="plane")
        rig.projector.show(trial_picture("white", (640, 360)))
        seen[defocus] = world.rate()[16:-16, 16:-16]
    colours = [seen["0"][y::2, x::2].mean() for y, x in ((0, 0), (0, 1), (1, 1))]
    assert min(colours) < 0.7 * max(colours)
    for y, x in np.ndindex(2, 2):
        assert seen["3"][y::2, x::2] == pytest.approx(seen["0"][y::2, x::2], rel=0.03)


def test_a_drawn_camera_sees_its_corners_darker() -> None:
    _, world = twin(truth="4", scene="plane")
    assert world.rig.flat_field is not None
    even = Renderer(world.rig.model_copy(update={"flat_field": None}), world.truth, film=False)
    white = np.full((360, 640, 3), 255, np.uint8)
    uneven = Renderer(world.rig, world.truth, film=False).expected(white)
    gain = uneven / np.maximum(even.expected(white), 1e-12)
    assert 0.9 <= gain[gain > 0].min() <= 0.96
    assert gain.max() == pytest.approx(1.0, abs=0.01)


def test_the_hand_puts_back_what_was_there_and_says_what_is() -> None:
    rig, world = twin(scene="plane", depth_mm="760")
    assert rig.put_back is not None
    assert rig.standing is not None
    before = shine(rig)
    rig.put_back()  # nothing was placed yet
    assert rig.standing() == "plane"
    place(rig, Placement(target="spectralon", options={"depth_mm": 650.0}, film=False, filter_nm=550.0))
    assert rig.standing() == "spectralon depth_mm=650, film off, filter 550 nm"
    place(rig, Placement(target="board"))
    assert world.scene_at(world.position_mm).name != "plane"
    rig.put_back()
    assert rig.standing() == "plane"
    assert world.truth.depth_mm == pytest.approx(760.0)
    np.testing.assert_array_equal(shine(rig), before)
    place(rig, PLANE)
    assert world.truth.depth_mm == pytest.approx(650.0), "it is placed again after it was put back"

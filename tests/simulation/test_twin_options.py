"""Options of the twin: their texts are read and refused by name, and all others go to the scene."""

from __future__ import annotations

import pytest

from dsl_core.errors import DeviceError, PlanError
from dsl_core.simulation.scenes.catalogue import make_scene
from dsl_core.simulation.sim_devices import SimCamera, open_twin
from dsl_core.simulation.twin_options import TwinOptions


def test_without_texts_every_option_has_its_default() -> None:
    chosen, of_scene = TwinOptions.of({})
    assert (chosen, of_scene) == (TwinOptions(), {})
    assert (chosen.scene, chosen.size, chosen.noise, chosen.film, chosen.truth) == (
        "color-checker", None, True, True, None,
    )  # fmt: skip
    assert (chosen.choice.text, str(chosen.limit)) == ("usual", "1 DN")


def test_texts_are_read_and_those_of_the_scene_are_left() -> None:
    texts = {
        "scene": "sphere", "size": "112X72", "seed": "3", "noise": "off", "realtime": "on", "truth": "0",
        "effects": "halo,blur", "tolerance": "0.5sigma", "wrong_filter_nm": "540", "gloss": "0.04",
    }  # fmt: skip
    chosen, of_scene = TwinOptions.of(texts)
    assert of_scene == {"gloss": "0.04"}
    assert (chosen.scene, chosen.size, chosen.seed) == ("sphere", (112, 72), 3)
    assert (chosen.noise, chosen.realtime, chosen.truth) == (False, True, 0)
    assert (chosen.limit.value, chosen.limit.unit, chosen.wrong_filter_nm) == (0.5, "sigma", 540.0)
    assert chosen.choice.names is not None
    assert {"halo", "blur"} < chosen.choice.names


@pytest.mark.parametrize(
    ("name", "text", "sentence"),
    [
        ("size", "890", "size must be like 890x580 (16 to 4096 pixels per side), not '890'"),
        ("size", "8x8", "size must be like 890x580 (16 to 4096 pixels per side), not '8x8'"),
        ("seed", "-1", "option seed must be a number of at least 0, not '-1'"),
        ("seed", "1e-3", "option seed must be a whole number, not '1e-3'"),
        ("truth", "2.5", "option truth must be a whole number, not '2.5'"),
        ("sigma", "much", "option sigma must be a number of at least 0, not 'much'"),
        ("brightness", "inf", "option brightness must be a number of at least 0, not 'inf'"),
        ("brightness", "0", "option brightness must be above 0, not '0'"),
        ("print_scale", "0", "option print_scale must be above 0, not '0'"),
        ("wrong_filter_nm", "blue", "option wrong_filter_nm must be a number of at least 0, not 'blue'"),
        ("noise", "yes", "option noise must be 'on' or 'off', not 'yes'"),
        ("target_missing", "", "option target_missing must be 'on' or 'off', not ''"),
        ("effects", "glow", "The twin has no effect 'glow'"),
        ("tolerance", "little", "like 1, 0.5DN or 2sigma, not 'little'"),
    ],
)
def test_a_wrong_text_is_refused_with_its_name_and_what_is_needed(
    name: str, text: str, sentence: str
) -> None:
    with pytest.raises(DeviceError) as raised:
        open_twin({name: text})
    assert sentence in str(raised.value)


def test_an_option_that_nobody_has_is_refused_by_the_scene() -> None:
    with pytest.raises(PlanError, match=r"'plane' has no option colour; its options are depth_mm"):
        open_twin({"scene": "plane", "colour": "red"})
    with pytest.raises(PlanError, match=r"'plane' has no option sizze; .* Did you mean size\?"):
        open_twin({"scene": "plane", "sizze": "112x72"})


def test_a_stage_stands_where_the_option_says() -> None:
    devices = open_twin({"scene": "stage", "depth_mm": "650", "size": "16x16"})
    assert devices.stage is not None
    assert devices.stage.position_mm == 650.0
    assert isinstance(devices.camera, SimCamera)
    assert devices.camera.world.truth.depth_mm == pytest.approx(650.0)
    with pytest.raises(DeviceError, match="option depth_mm must be a number of at least 0, not 'near'"):
        open_twin({"scene": "plane", "depth_mm": "near"})


def test_a_device_that_is_not_there_is_told_before_anything_is_captured(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with pytest.raises(DeviceError, match="option device must be 'cpu' or 'cuda', not 'abc'"):
        open_twin({"size": "16x16", "device": "abc"})
    monkeypatch.setattr("dsl_core.solve.torch_device.has_cuda", lambda: False)
    with pytest.raises(DeviceError, match=r"on 'cuda'\. There is no CUDA device, .* Choose the device cpu"):
        open_twin({"size": "16x16", "device": "cuda"})


@pytest.mark.parametrize(
    ("texts", "depth_mm"),
    [
        ({}, 700.0),
        ({"position_mm": "750"}, 750.0),
        ({"index": "3"}, 600 + 3 * 300 / 14),
        ({"index": "14", "reflectance": "0.5"}, 900.0),
    ],
)
def test_a_stage_takes_the_options_that_are_listed_for_it(texts: dict[str, str], depth_mm: float) -> None:
    devices = open_twin({"scene": "stage", "size": "16x16", **texts})
    assert devices.stage is not None
    assert devices.stage.position_mm == pytest.approx(depth_mm)
    assert isinstance(devices.camera, SimCamera)
    world = devices.camera.world
    assert world.truth.depth_mm == pytest.approx(depth_mm)
    devices.stage.move_to(650.0)
    assert world.truth.depth_mm == pytest.approx(650.0)
    # The scene by itself stands where the twin puts it.
    if "reflectance" not in texts:
        seen = make_scene("stage", **texts).render(world.rig.camera, world.rig.pose.projector_centre_mm)
        assert seen.depth_mm == pytest.approx(depth_mm)


@pytest.mark.parametrize(
    ("texts", "words"),
    [
        ({"index": "15"}, "Option index must be between 0 and 14, not 15"),
        ({"index": "near"}, "Option index of scene 'stage' must be a whole number"),
        ({"position_mm": "5"}, "Option position_mm must be between 100 and 5000 mm, not 5"),
        ({"position_mm": "650", "index": "3"}, "Options position_mm and index all say where"),
        ({"depth_mm": "650", "index": "3"}, "Options depth_mm and index all say where"),
    ],
)
def test_a_stage_stands_at_one_place_within_its_range(texts: dict[str, str], words: str) -> None:
    with pytest.raises(PlanError, match=words):
        open_twin({"scene": "stage", "size": "16x16", **texts})

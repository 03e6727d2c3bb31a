"""The twin's devices keep every promise of a rig and measure what the world holds."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.devices.base import Camera, DeviceRig, Projector, Spectroradiometer, Stage
from dsl_core.devices.conformance import (
    CameraConformance,
    ProjectorConformance,
    RigConformance,
    SpectroradiometerConformance,
    StageConformance,
)
from dsl_core.devices.registry import open_rig
from dsl_core.errors import DeviceError
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.sim_devices import SimCamera, SimSpectroradiometer, open_twin

SIZE = (64, 42)


def bands_of_columns(*bands: tuple[int, int], level: int = 255) -> NDArray[np.uint8]:
    image = np.zeros((360, 640, 3), np.uint8)
    for start, stop in bands:
        image[:, start:stop] = level
    return image


def open_small(**options: str) -> DeviceRig:
    return open_twin({"size": f"{SIZE[0]}x{SIZE[1]}", "scene": "plane", **options})


def test_stage_moves_the_plane_and_dims_it() -> None:
    rig = open_small(noise="off")
    assert rig.stage is not None
    assert isinstance(rig.camera, SimCamera)
    means = []
    for position in (600.0, 900.0):
        assert rig.stage.move_to(position) == position
        assert rig.camera.world.truth.depth_mm == pytest.approx(position)
        rig.projector.show(bands_of_columns((0, 640), level=60))
        means.append(rig.camera.snap().pixels.mean() - 260)
    assert means[0] / means[1] == pytest.approx((900 / 600) ** 2, rel=0.12)
    with pytest.raises(DeviceError, match="travels from"):
        rig.stage.move_to(1200.0)


@pytest.mark.parametrize("grey", [True, False])
def test_spectroradiometer_sees_the_leds_through_the_target(grey: bool) -> None:
    rig = open_small(noise="off", film="off")
    meter = rig.spectroradiometer
    assert isinstance(meter, SimSpectroradiometer)
    dark = np.array(meter.measure().values)
    image = np.full((360, 640), 255, np.uint8)
    rig.projector.show(image if grey else np.repeat(image[..., None], 3, 2))
    curve = meter.measure()
    emission = sum(led.at(np.array(curve.wavelengths_nm)) for led in published_rig().emission)
    assert np.array(curve.values) == pytest.approx(0.99 * emission, rel=1e-6)
    black = published_rig().projector_response.black_fraction
    assert dark == pytest.approx(black * np.array(curve.values), rel=1e-6)


def test_spectroradiometer_sees_first_orders_through_the_film() -> None:
    curves = {}
    for film in ("on", "off"):
        rig = open_small(noise="off", film=film)
        assert rig.spectroradiometer is not None
        rig.projector.show(np.full((360, 640), 255, np.uint8))
        curves[film] = rig.spectroradiometer.measure()
    nm = np.array([450.0, 550.0])
    gain = curves["on"].at(nm) / curves["off"].at(nm) - 1
    efficiency = published_rig().efficiency
    assert (gain > 0.5 * efficiency[-1].at(nm)).all()
    assert (gain < 1.01 * (efficiency[1].at(nm) + efficiency[-1].at(nm))).all()


def test_spectroradiometer_noise_is_a_share_of_the_peak() -> None:
    meters = {noise: open_small(noise=noise) for noise in ("on", "off")}
    curves = {}
    for noise, rig in meters.items():
        assert rig.spectroradiometer is not None
        rig.projector.show(bands_of_columns((0, 640)))
        curves[noise] = np.array(rig.spectroradiometer.measure().values)
    spread = (curves["on"] - curves["off"]).std() / curves["off"].max()
    assert spread == pytest.approx(SimSpectroradiometer.NOISE, rel=0.15)


class TestTwin(
    CameraConformance, ProjectorConformance, StageConformance, SpectroradiometerConformance, RigConformance
):
    frame_count = 10  # nothing counts in few bits here, and each is rendered

    def open_rig(self) -> DeviceRig:
        return open_rig("twin", {"size": "32x24", "scene": "plane"})

    def open_camera(self) -> Camera:
        rig = self.open_rig()
        return rig.camera

    def open_projector(self) -> Projector:
        return self.open_rig().projector

    def open_stage(self) -> Stage:
        stage = self.open_rig().stage
        assert stage is not None
        return stage

    def open_spectroradiometer(self) -> Spectroradiometer:
        instrument = self.open_rig().spectroradiometer
        assert instrument is not None
        return instrument


@pytest.mark.parametrize(("effects", "is_told"), [("usual", True), ("auto", False)])
def test_an_option_that_shows_in_no_picture_is_told(
    effects: str, is_told: bool, caplog: pytest.LogCaptureFixture
) -> None:
    open_twin({"scene": "sphere", "gloss": "0.5", "size": "32x24", "effects": effects})
    assert ("effects=auto" in caplog.text) == is_told

"""What every driver has to pass, as test classes for pytest.

A driver's test module subclasses the class of its kind and says how to open the device::

    from dsl_core.devices.conformance import CameraConformance

    class TestMyCamera(CameraConformance):
        def open_camera(self) -> Camera:
            return MyCamera()

The promises are those of `dsl_core.devices.base`. pytest itself is not imported here.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import get_args

import numpy as np

from dsl_core.devices.base import Camera, CameraInfo, Projector, Spectroradiometer, Stage
from dsl_core.devices.conformance_of_rig import RigParts
from dsl_core.devices.conformance_of_rig import require as _require
from dsl_core.errors import DeviceError
from dsl_core.model.frames import Frame
from dsl_core.model.rig import BayerPattern

#: So many frames may be lost one after the other.
MOST_LOST = 2


class CameraConformance:
    """Promises of a `Camera`; ``exposure_ms`` is used where any exposure will do.

    ``frame_count`` frames are counted: a number that cameras keep in few bits begins again within so many.
    """

    exposure_ms = 10.0
    frame_count = 140

    def open_camera(self) -> Camera:
        """Open the camera under test."""
        raise NotImplementedError("say in the subclass how the camera is opened")

    def test_camera_info_is_plausible_and_constant(self) -> None:
        """Size, mosaic, depth and exposure range make sense and do not change."""
        with self.open_camera() as camera:
            info = camera.info
            _require(info.width_px > 0 and info.height_px > 0, f"the image size of {info} is empty")
            known = get_args(BayerPattern)
            _require(info.bayer in known, f"{info.bayer} is not a mosaic, nor MONO")
            _require(8 <= info.bit_depth <= 16, f"{info.bit_depth} bits are not between 8 and 16")
            low, high = info.exposure_range_ms
            _require(0 < low <= high < math.inf, f"the exposure range {low} to {high} ms is not a range")
            _require(info.binning >= 1, f"a binning of {info.binning} is impossible; 1 is none")
            _require(math.isfinite(info.gain_db), f"a gain of {info.gain_db} dB is impossible")
            if info.region_px is not None:
                self._check_region(info)
            self._snap(camera)
            _require(camera.info == info, "the info changed while the camera was open")

    def test_camera_returns_the_exposure_in_force(self) -> None:
        """An exposure inside the range is taken, and said to be."""
        with self.open_camera() as camera:
            wanted_ms = self._exposure_ms(camera)
            actual_ms = camera.configure(wanted_ms)
            _require(
                abs(actual_ms - wanted_ms) <= 0.05 * wanted_ms,
                f"configure({wanted_ms}) set {actual_ms} ms, more than 5 % away",
            )
            frame = _delivered(camera)
            _require(
                abs(frame.exposure_ms - actual_ms) <= 0.01 * actual_ms,
                f"the frame says {frame.exposure_ms} ms, configure said {actual_ms} ms",
            )

    def test_camera_refuses_exposures_out_of_range(self) -> None:
        """Shorter and longer exposures than the range raise `DeviceError`."""
        with self.open_camera() as camera:
            low, high = camera.info.exposure_range_ms
            for exposure_ms in (low / 2, high * 2):
                _refuses(partial(camera.configure, exposure_ms), f"configure({exposure_ms:g})")

    def test_camera_delivers_the_raw_mosaic(self) -> None:
        """Frames are uint16, of the size promised, right-aligned."""
        with self.open_camera() as camera:
            info = camera.info
            pixels = self._snap(camera).pixels
            _require(pixels.dtype == np.uint16, f"pixels are {pixels.dtype}, not uint16")
            wanted = (info.height_px, info.width_px)
            _require(pixels.shape == wanted, f"the frame has shape {pixels.shape}, not {wanted}")
            brightest = int(pixels.max())
            _require(
                brightest < 2**info.bit_depth,
                f"a pixel reads {brightest}, too much for {info.bit_depth} bits (left-aligned?)",
            )
            used, step = int(np.bitwise_or.reduce(pixels, axis=None)), 1 << (16 - info.bit_depth)
            _require(
                step == 1 or used == 0 or used % step != 0,
                f"all values are multiples of {step}: {info.bit_depth} bits at the upper end of 16",
            )

    def test_camera_counts_frames(self) -> None:
        """Frame numbers rise by at least one, time never runs backwards."""
        with self.open_camera() as camera:
            camera.configure(
                min(max(1.0, camera.info.exposure_range_ms[0]), camera.info.exposure_range_ms[1])
            )
            before: Frame | None = None
            for count in range(self.frame_count):
                camera.prepare(count % 3)
                frame = _delivered(camera)
                if before is not None:
                    _require(
                        frame.frame_id > before.frame_id,
                        f"frame number {frame.frame_id} follows {before.frame_id}; they must rise. Count on"
                        " where the camera's own numbers begin again",
                    )
                    _require(
                        frame.timestamp_s >= before.timestamp_s,
                        f"the time {frame.timestamp_s} s follows {before.timestamp_s} s: it runs backwards",
                    )
                before = frame

    def test_camera_frames_stay_as_they_are(self) -> None:
        """A later frame does not overwrite an earlier one."""
        with self.open_camera() as camera:
            first = self._snap(camera).pixels
            kept = first.copy()
            second = self._snap(camera, 1).pixels
            _require(not np.shares_memory(first, second), "two frames share one buffer; copy it")
            _require(np.array_equal(first, kept), "the second frame overwrote the first")

    def test_camera_closes_twice(self) -> None:
        """Closing again does nothing."""
        camera = self.open_camera()
        camera.close()
        camera.close()

    def _check_region(self, info: CameraInfo) -> None:
        """A region is on the sensor and makes the image size."""
        x, y, width, height = info.region_px or (0, 0, 0, 0)
        size = (width // info.binning, height // info.binning)
        _require(x >= 0 and y >= 0, f"the region {info.region_px} starts outside the sensor")
        _require(
            size == (info.width_px, info.height_px),
            f"the region {info.region_px} with binning {info.binning} makes {size[0]} x {size[1]} pixels,"
            f" the images have {info.width_px} x {info.height_px}",
        )

    def _exposure_ms(self, camera: Camera) -> float:
        low, high = camera.info.exposure_range_ms
        return min(max(self.exposure_ms, low), high)

    def _snap(self, camera: Camera, shot_index: int = 0) -> Frame:
        camera.configure(self._exposure_ms(camera))
        camera.prepare(shot_index)
        return _delivered(camera)


class ProjectorConformance:
    """Promises of a `Projector`."""

    def open_projector(self) -> Projector:
        """Open the projector under test."""
        raise NotImplementedError("say in the subclass how the projector is opened")

    def test_projector_info_is_plausible(self) -> None:
        """Size and timing make sense."""
        with self.open_projector() as projector:
            info = projector.info
            _require(info.width_px > 0 and info.height_px > 0, f"the size of {info} is empty")
            _require(0 <= info.latency_ms < math.inf, f"a latency of {info.latency_ms} ms is impossible")
            _require(info.frame_period_ms > 0, f"a frame period of {info.frame_period_ms} ms is impossible")

    def test_projector_shows_grey_and_colour(self) -> None:
        """Grey and RGB images of its size are accepted and left as they are."""
        with self.open_projector() as projector:
            height, width = projector.info.height_px, projector.info.width_px
            for shape in ((height, width), (height, width, 3)):
                image = np.full(shape, 7, np.uint8)
                image.flags.writeable = False
                projector.show(image)
                _require(bool((image == 7).all()), "show changed the image it was given")

    def test_projector_refuses_other_images(self) -> None:
        """Another size or type raises `DeviceError`."""
        with self.open_projector() as projector:
            height, width = projector.info.height_px, projector.info.width_px
            for shape in ((height, width + 1), (height + 1, width), (height, width, 4), (width,)):
                image = np.zeros(shape, np.uint8)
                _refuses(partial(projector.show, image), f"show of shape {shape}")
            levels = np.zeros((height, width), np.float64)
            _refuses(lambda: projector.show(levels), "show of float64")  # type: ignore[arg-type]

    def test_projector_closes_twice(self) -> None:
        """Closing again does nothing."""
        projector = self.open_projector()
        projector.close()
        projector.close()


class StageConformance:
    """Promises of a `Stage`; ``tolerance_mm`` is how exactly it has to arrive."""

    tolerance_mm = 0.1

    def open_stage(self) -> Stage:
        """Open the stage under test."""
        raise NotImplementedError("say in the subclass how the stage is opened")

    def test_stage_arrives(self) -> None:
        """Both ends and the middle of the range are reached, and the position says so."""
        with self.open_stage() as stage:
            low, high = stage.range_mm
            _require(low < high, f"the range {low} to {high} mm is empty")
            for target_mm in (low, high, (low + high) / 2):
                reached_mm = stage.move_to(target_mm)
                off_mm = max(abs(reached_mm - target_mm), abs(stage.position_mm - target_mm))
                _require(off_mm <= self.tolerance_mm, f"sent to {target_mm} mm it is {off_mm:g} mm off")

    def test_stage_refuses_positions_out_of_range(self) -> None:
        """Beyond the range it raises `DeviceError` and stays where it is."""
        with self.open_stage() as stage:
            low, high = stage.range_mm
            before_mm = stage.position_mm
            for target_mm in (low - 1.0, high + 1.0):
                _refuses(partial(stage.move_to, target_mm), f"move_to({target_mm:g})")
            moved_mm = abs(stage.position_mm - before_mm)
            _require(moved_mm <= self.tolerance_mm, f"a refused move still moved it by {moved_mm:g} mm")

    def test_stage_closes_twice(self) -> None:
        """Closing again does nothing."""
        stage = self.open_stage()
        stage.close()
        stage.close()


class SpectroradiometerConformance:
    """Promises of a `Spectroradiometer`."""

    def open_spectroradiometer(self) -> Spectroradiometer:
        """Open the instrument under test."""
        raise NotImplementedError("say in the subclass how the spectroradiometer is opened")

    def test_spectroradiometer_measures_radiance(self) -> None:
        """The curve has the unit of spectral radiance and covers the visible bands, twice alike."""
        with self.open_spectroradiometer() as instrument:
            first, second = instrument.measure(), instrument.measure()
            _require(first.unit == "W/(sr m2 nm)", f"the unit is {first.unit!r}, not 'W/(sr m2 nm)'")
            low, high = first.wavelengths_nm[0], first.wavelengths_nm[-1]
            _require(low <= 430 and high >= 660, f"{low} to {high} nm do not cover 430 to 660 nm")
            _require(first.wavelengths_nm == second.wavelengths_nm, "the wavelengths change between readings")

    def test_spectroradiometer_closes_twice(self) -> None:
        """Closing again does nothing."""
        instrument = self.open_spectroradiometer()
        instrument.close()
        instrument.close()


class RigConformance(RigParts):
    """Promises of a whole rig; ``sees_projector`` is false for rigs that only play back."""

    sees_projector = True

    def test_rig_calibration_fits_its_devices(self) -> None:
        """A calibration that comes with the rig is for these image sizes and this mosaic."""
        with self.open_rig() as rig:
            _require(bool(rig.name), "the rig has no name")
            known, camera, projector = rig.calibration, rig.camera.info, rig.projector.info
            if known is None:
                return
            sizes = (known.camera.width_px, known.camera.height_px), (camera.width_px, camera.height_px)
            _require(sizes[0] == sizes[1], f"calibrated for images of {sizes[0]}, the camera has {sizes[1]}")
            sizes = (
                (known.projector.width_px, known.projector.height_px),
                (projector.width_px, projector.height_px),
            )
            _require(sizes[0] == sizes[1], f"calibrated for patterns of {sizes[0]}, not {sizes[1]}")
            _require(known.sensor.bayer == camera.bayer, "calibration and camera have different mosaics")
            _require(known.sensor.bit_depth == camera.bit_depth, "calibration and camera differ in bit depth")

    def test_rig_camera_sees_what_the_projector_shows(self) -> None:
        """The first frame after ``show`` has the new pattern: white, and then black at once."""
        if not self.sees_projector:
            return
        with self.open_rig() as rig:
            info = rig.projector.info
            low, high = rig.camera.info.exposure_range_ms
            rig.camera.configure(min(max(3 * info.frame_period_ms, low), high))
            means = []
            for shot, level in enumerate((0, 255, 0)):
                rig.projector.show(np.full((info.height_px, info.width_px), level, np.uint8))
                rig.camera.prepare(shot)
                means.append(float(_delivered(rig.camera).pixels.mean()))
            black, white, black_again = means
            _require(
                white > black,
                f"white reads {white:g} DN in the mean, black {black:g}: no light arrives, or show returns"
                " before the pattern is visible",
            )
            _require(
                abs(black_again - black) < 0.1 * (white - black),
                f"black reads {black_again:g} DN after white and {black:g} before: show returns too early",
            )

    def test_rig_closes_twice(self) -> None:
        """Closing again does nothing."""
        rig = self.open_rig()
        rig.close()
        rig.close()


def _delivered(camera: Camera) -> Frame:
    """A frame; one that is lost raises `DeviceError`, and as in a scan the next one is asked for."""
    for _ in range(MOST_LOST):
        with suppress(DeviceError):
            return camera.snap()
    return camera.snap()


def _refuses(action: Callable[[], object], what: str) -> None:
    try:
        action()
    except DeviceError as error:
        _require(len(str(error)) > 20, f"{what} raises {error!s:.20} without saying what to do")
    else:
        raise AssertionError(f"{what} was accepted instead of raising DeviceError")

"""Drivers that hang, raise or deliver what cannot be become errors that say which device did what."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.devices.base import (
    Camera,
    CameraInfo,
    DeviceRig,
    Patience,
    Projector,
    ProjectorInfo,
    Spectroradiometer,
    Stage,
)
from dsl_core.devices.device_thread import DeviceThread
from dsl_core.devices.guard import guarded, open_on
from dsl_core.devices.plausible import require_light, require_spectrum
from dsl_core.errors import DeviceError, StoreError
from dsl_core.model.frames import Frame
from dsl_core.model.spectral import SpectralCurve

Act = Callable[[], Any]
FRAME = Frame(np.zeros((4, 6), np.uint16), 10.0, 1.0, 1)
NM = np.linspace(400, 700, 61)
LIGHT = SpectralCurve.of(NM, np.exp(-(((NM - 550) / 40) ** 2)), unit="W/(sr m2 nm)")


class _Lab(Camera, Projector, Stage, Spectroradiometer):
    """All devices at once; ``act`` replaces what one of the methods does."""

    def __init__(self, is_camera: bool = True) -> None:
        self.camera_info = CameraInfo("Eye", "1", 6, 4, "RGGB", 12, (1.0, 100.0))
        self.projector_info = ProjectorInfo("Beam", "2", 8, 4, 0.0, 1.0)
        self.is_camera = is_camera
        self.act: dict[str, Act] = {}
        self.threads: list[threading.Thread] = []
        self.at_mm = 600.0

    def _do(self, name: str, usual: Act) -> Any:
        self.threads.append(threading.current_thread())
        return self.act.get(name, usual)()

    @property
    def info(self) -> Any:
        return self.camera_info if self.is_camera else self.projector_info

    def configure(self, exposure_ms: float) -> float:
        return float(self._do("configure", lambda: exposure_ms))

    def snap(self, timeout_ms: float = 5000.0) -> Frame:
        return self._do("snap", lambda: FRAME)  # type: ignore[no-any-return]

    def show(self, image: Any) -> None:
        self._do("show", lambda: None)

    range_mm = (500.0, 1000.0)

    @property
    def position_mm(self) -> float:
        return self.at_mm

    def move_to(self, position_mm: float) -> float:
        self.at_mm = self._do("move_to", lambda: position_mm)
        return self.at_mm

    def measure(self) -> SpectralCurve:
        return self._do("measure", lambda: LIGHT)  # type: ignore[no-any-return]

    def close(self) -> None:
        self._do("close", lambda: None)


@pytest.fixture
def lab() -> _Lab:
    return _Lab()


@pytest.fixture
def beam() -> _Lab:
    return _Lab(is_camera=False)


@pytest.fixture
def rig(lab: _Lab, beam: _Lab) -> DeviceRig:
    rig = DeviceRig("lab", lab, beam, stage=lab, spectroradiometer=lab)
    return guarded(rig, DeviceThread("lab"))


def _raise(error: Exception) -> None:
    raise error


def _be_impatient(device: Any) -> None:
    """Only with a device that hangs: on a busy machine, others may take a while."""
    device._patience = Patience(0.05, 0.05, 0.05, 0.05)


@pytest.fixture
def stop() -> Iterator[threading.Event]:
    """Calls that wait for this hang until the test ends."""
    event = threading.Event()
    yield event
    event.set()


def test_a_call_that_hangs_is_given_up_and_the_projector_still_answers(
    lab: _Lab, beam: _Lab, rig: DeviceRig, stop: threading.Event
) -> None:
    _be_impatient(rig.camera)
    lab.act["snap"] = stop.wait
    with pytest.raises(DeviceError, match="Eye was asked to take a picture, but has not returned for"):
        rig.camera.snap(timeout_ms=0.0)
    with pytest.raises(DeviceError, match=r"set an exposure of 10 ms, but has not returned for 0\.05 s"):
        rig.camera.configure(10.0)
    rig.projector.show(np.zeros((4, 8), np.uint8))
    with pytest.raises(DeviceError, match="camera Eye was asked to close"):
        rig.close()
    assert beam.threads[-1] is not lab.threads[0]


def test_a_device_that_returns_after_all_can_be_used_again(
    lab: _Lab, rig: DeviceRig, stop: threading.Event
) -> None:
    _be_impatient(rig.camera)
    lab.act["snap"] = stop.wait
    with pytest.raises(DeviceError):
        rig.camera.snap(timeout_ms=0.0)
    stop.set()
    lab.threads[-1].join()
    lab.act.clear()
    rig.camera._patience = Patience()  # type: ignore[attr-defined]
    assert rig.camera.configure(10.0) == 10.0


@pytest.mark.parametrize(
    ("device", "verb", "use"),
    [
        ("camera", "configure", lambda camera: camera.configure(10.0)),
        ("projector", "show", lambda projector: projector.show(np.zeros((4, 8), np.uint8))),
        ("stage", "move_to", lambda stage: stage.move_to(700.0)),
        ("spectroradiometer", "measure", lambda instrument: instrument.measure()),
        ("projector", "close", lambda projector: projector.close()),
    ],
)
def test_every_call_is_bounded(
    device: str, verb: str, use: Any, lab: _Lab, beam: _Lab, rig: DeviceRig, stop: threading.Event
) -> None:
    _be_impatient(getattr(rig, device))
    lab.act[verb] = beam.act[verb] = stop.wait
    with pytest.raises(DeviceError, match=rf"The {device}.* was asked to .*has not returned for 0\.05 s"):
        use(getattr(rig, device))


def test_all_calls_come_from_one_thread_which_ends_with_the_last_device(
    lab: _Lab, beam: _Lab, rig: DeviceRig
) -> None:
    rig.camera.snap()
    rig.projector.show(np.zeros((4, 8), np.uint8))
    elsewhere = threading.Thread(target=rig.camera.snap)
    elsewhere.start()
    elsewhere.join()
    assert len({*lab.threads, *beam.threads}) == 1
    assert threading.current_thread() not in lab.threads
    rig.close()
    rig.close()
    lab.threads[0].join(60)
    assert not lab.threads[0].is_alive()


def test_without_a_thread_drivers_are_called_where_one_is(lab: _Lab, beam: _Lab) -> None:
    guarded(DeviceRig("lab", lab, beam), None).camera.snap()
    assert lab.threads == [threading.current_thread()]


@pytest.mark.parametrize("thread", [True, False])
def test_what_did_open_is_let_go_where_another_device_does_not_answer(
    lab: _Lab, beam: _Lab, thread: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    closed: list[str] = []

    def gone() -> None:
        raise OSError("gone")

    monkeypatch.setattr(_Lab, "info", property(lambda self: lab.camera_info if self is lab else gone()))
    lab.act["close"] = lambda: closed.append("camera")
    beam.act["close"] = gone
    with pytest.raises(DeviceError, match="The projector"):
        guarded(DeviceRig("lab", lab, beam), DeviceThread("lab") if thread else None)
    assert closed == ["camera"]


def test_a_device_that_does_not_close_spoils_nothing_that_was_done(
    lab: _Lab, rig: DeviceRig, caplog: pytest.LogCaptureFixture
) -> None:
    lab.act["close"] = lambda: _raise(RuntimeError("handle is invalid"))
    with rig:
        pass
    assert "handle is invalid" in caplog.text
    with pytest.raises(KeyError, match="the reason"), rig:
        raise KeyError("the reason")


@pytest.mark.parametrize("thread", [True, False])
def test_whatever_a_driver_raises_names_the_device(lab: _Lab, beam: _Lab, thread: bool) -> None:
    def fail() -> None:
        raise ValueError("bad\n  register" + "!" * 500)

    lab.act["snap"] = fail
    rig = guarded(DeviceRig("lab", lab, beam), DeviceThread("lab") if thread else None)
    with pytest.raises(DeviceError, match=r"Eye could not take a picture \(ValueError: bad register!!"):
        rig.camera.snap()


def test_a_record_that_a_driver_cannot_make_is_told_in_words(lab: _Lab, rig: DeviceRig) -> None:
    lab.act["measure"] = lambda: SpectralCurve.of(NM, np.full(61, np.nan), unit=LIGHT.unit)
    assert rig.spectroradiometer is not None
    with pytest.raises(DeviceError) as raised:
        rig.spectroradiometer.measure()
    assert "values.0 must be a finite number (given nan)" in str(raised.value)
    assert "pydantic.dev" not in str(raised.value)


def test_sentences_of_our_own_are_passed_on(lab: _Lab, rig: DeviceRig) -> None:
    def fail() -> None:
        raise StoreError("The replayed frame is damaged.")

    lab.act["snap"] = fail
    with pytest.raises(StoreError, match=r"^The replayed frame is damaged\.$"):
        rig.camera.snap()


def test_a_driver_that_ends_the_program_does_not(lab: _Lab, rig: DeviceRig) -> None:
    def fail() -> None:
        raise SystemExit(3)

    lab.act["configure"] = fail
    with pytest.raises(DeviceError, match="SystemExit: 3"):
        rig.camera.configure(10.0)


def test_opening_passes_errors_on_and_is_bounded_too() -> None:
    def fail() -> None:
        raise KeyError("port")

    with pytest.raises(KeyError, match="port"):
        open_on(DeviceThread("lab"), "lab", fail)
    assert open_on(DeviceThread("lab"), "lab", threading.current_thread) is not threading.current_thread()


@pytest.mark.parametrize(
    ("frame", "sentence"),
    [
        (None, "delivered NoneType instead of a picture"),
        (replace(FRAME, pixels=np.zeros((4, 5), np.uint16)), "picture of 5 × 4 px instead of 6 × 4 px"),
        (replace(FRAME, pixels=np.zeros((4, 6, 3), np.uint16)), "with colours .4 × 6 × 3 numbers."),
        (replace(FRAME, pixels=np.zeros((4, 6), np.uint8)), "picture in uint8 instead of uint16"),
        (replace(FRAME, pixels=np.full((4, 6), 4096, np.uint16)), "a value of 4096; with 12 bits, 4095"),
        (replace(FRAME, pixels=np.repeat([[9], [9], [9], [0]], 6, 1).astype(np.uint16)), "1 of 4 rows empty"),
        (replace(FRAME, exposure_ms=5.0), "exposes for 5 ms instead of 10 ms"),
        (replace(FRAME, exposure_ms=float("nan")), "exposed for nan ms"),
        (replace(FRAME, frame_id=None), "the number of a frame is None"),  # type: ignore[arg-type]
        (replace(FRAME, frame_id=float("nan")), "the number of a frame is nan"),  # type: ignore[arg-type]
        (replace(FRAME, frame_id=float("inf")), "the number of a frame is inf"),  # type: ignore[arg-type]
        (replace(FRAME, timestamp_s=10**400), r"the time of a frame is 1000\d*. Update its driver"),
    ],
)
def test_frames_that_cannot_be_are_refused(frame: Any, sentence: str, lab: _Lab, rig: DeviceRig) -> None:
    rig.camera.configure(10.0)
    lab.act["snap"] = lambda: frame
    with pytest.raises(DeviceError, match=sentence):
        rig.camera.snap()


def test_pixels_that_a_driver_masks_are_pixels(lab: _Lab, rig: DeviceRig) -> None:
    rig.camera.configure(10.0)
    pixels = np.ma.masked_array(np.full((4, 6), 9, np.uint16), np.eye(4, 6, dtype=bool))
    lab.act["snap"] = lambda: replace(FRAME, pixels=pixels)
    assert type(rig.camera.snap().pixels) is np.ndarray


def test_rows_without_any_count_are_dark_where_a_black_picture_had_none_either(
    lab: _Lab, rig: DeviceRig
) -> None:
    rig.camera.configure(10.0)
    cut = np.repeat([[9], [9], [9], [0]], 6, 1).astype(np.uint16)
    for pixels in (cut + 9, cut * 0, cut):
        lab.act["snap"] = partial(replace, FRAME, pixels=pixels)
        np.testing.assert_array_equal(rig.camera.snap().pixels, pixels)


def test_rows_that_are_empty_again_are_dark_unless_they_had_counts(lab: _Lab, rig: DeviceRig) -> None:
    rig.camera.configure(10.0)
    whole = np.full((4, 6), 9, np.uint16)
    void, cut = whole.copy(), whole.copy()
    void[3], cut[2:] = 0, 0

    def snap(pixels: NDArray[np.uint16]) -> None:
        lab.act["snap"] = partial(replace, FRAME, pixels=pixels)
        rig.camera.snap()

    with pytest.raises(DeviceError, match="1 of 4 rows empty"):
        snap(void)
    snap(void * (np.arange(24).reshape(4, 6) != 8))
    snap(void)
    snap(void + (void > 0))
    for _ in range(3):
        with pytest.raises(DeviceError, match="2 of 4 rows empty"):
            snap(cut)


@pytest.mark.parametrize("black_dn", [1, 2, 16, 64])
def test_rows_that_are_always_empty_are_cut_off_where_others_have_a_black_level(
    lab: _Lab, rig: DeviceRig, black_dn: int
) -> None:
    rig.camera.configure(10.0)
    for light_dn in (0, 0, 900, 5):
        pixels = np.repeat([[black_dn + light_dn], [black_dn], [0], [0]], 6, 1).astype(np.uint16)
        lab.act["snap"] = partial(replace, FRAME, pixels=pixels)
        with pytest.raises(DeviceError, match="2 of 4 rows empty"):
            rig.camera.snap()


@pytest.mark.parametrize("flaw", ["dead pixel", "dead pixel in the first row", "cut within a row"])
def test_rows_are_missing_though_some_pixels_of_others_have_no_count(
    flaw: str, lab: _Lab, beam: _Lab
) -> None:
    """Transfers seldom end with a row, and each camera has dead pixels: either let all missing rows pass."""
    lab.camera_info = replace(lab.camera_info, width_px=200, height_px=40)
    rig = guarded(DeviceRig("lab", lab, beam), DeviceThread("lab"))
    pixels = np.full((40, 200), 64, np.uint16)
    pixels[30:] = 0
    places: dict[str, tuple[int, int | slice]] = {
        "dead pixel": (5, 7),
        "dead pixel in the first row": (0, 9),
        "cut within a row": (29, slice(90, 200)),
    }
    pixels[places[flaw]] = 0
    lab.act["snap"] = partial(replace, FRAME, pixels=pixels)
    rig.camera.configure(10.0)
    for _ in range(3):
        with pytest.raises(DeviceError, match="10 of 40 rows empty"):
            rig.camera.snap()


def test_a_driver_may_fill_the_same_memory_again(lab: _Lab, rig: DeviceRig) -> None:
    buffer = np.zeros((4, 6), np.uint16)
    lab.act["snap"] = lambda: replace(FRAME, pixels=buffer)
    first = rig.camera.snap()
    buffer[:] = 7
    assert first.pixels.max() == 0


def test_a_device_that_changes_what_it_is_is_told(lab: _Lab, beam: _Lab, rig: DeviceRig) -> None:
    beam.projector_info = replace(beam.projector_info, width_px=16)
    with pytest.raises(DeviceError, match="projector Beam changed width_px from 8 to 16"):
        rig.projector.show(np.zeros((4, 8), np.uint8))
    lab.camera_info = replace(lab.camera_info, bit_depth=8)
    with pytest.raises(DeviceError, match="camera Eye changed bit_depth from 12 to 8"):
        rig.camera.snap()


@pytest.mark.parametrize("reached_mm", [600.0, 712.0, float("nan")])
def test_a_stage_that_is_elsewhere_is_told_after_a_second_try(
    reached_mm: float, lab: _Lab, rig: DeviceRig
) -> None:
    lab.act["move_to"] = lambda: reached_mm
    assert rig.stage is not None
    with pytest.raises(DeviceError, match="sent to 700 mm and says that it went to"):
        rig.stage.move_to(700.0)
    tries = iter([reached_mm, 700.2])
    lab.act["move_to"] = lambda: next(tries)
    assert rig.stage.move_to(700.0) == 700.2


def test_a_stage_that_says_what_it_was_asked_is_read(lab: _Lab, rig: DeviceRig) -> None:
    lab_stage = type("Stuck", (_Lab,), {"position_mm": 600.0, "move_to": lambda self, mm: mm})()
    rig = guarded(DeviceRig("lab", lab, _Lab(is_camera=False), stage=lab_stage), None)
    assert rig.stage is not None
    with pytest.raises(DeviceError, match="sent to 700 mm and then says that it is at 600 mm"):
        rig.stage.move_to(700.0)


@pytest.mark.parametrize(
    ("curve", "sentence"),
    [
        (
            LIGHT.model_copy(update={"values": (float("nan"),) * 61}),
            "61 of its 61 values are infinite",
        ),
        (SpectralCurve.of(NM / 1000, np.ones(61), unit=LIGHT.unit), "not those of light in nm"),
        (SpectralCurve.of(NM[20:], LIGHT.at(NM[20:]), unit=LIGHT.unit), "covers 500 to 700 nm"),
        (SpectralCurve.of(NM, np.full(61, 0.3), unit=LIGHT.unit), "every value is 0.3"),
        (SpectralCurve.of(NM, np.minimum(LIGHT.at(NM), 0.4), unit=LIGHT.unit), "it is saturated"),
        (SpectralCurve.of(NM, LIGHT.at(NM), unit="1"), "its unit is '1'"),
        (SpectralCurve.of([430, 660], [1, 2], unit=LIGHT.unit), "it has 2 samples"),
    ],
)
def test_spectra_that_cannot_be_are_refused(
    curve: SpectralCurve, sentence: str, lab: _Lab, rig: DeviceRig
) -> None:
    lab.act["measure"] = lambda: curve
    assert rig.spectroradiometer is not None
    with pytest.raises(DeviceError, match=sentence):
        rig.spectroradiometer.measure()


def _hump(nm: NDArray[np.float64], width_nm: float, digits: int) -> NDArray[np.float64]:
    values = 0.0123 * np.exp(-0.5 * ((nm - 540) / width_nm) ** 2)
    return np.array([float(f"{each:.{digits - 1}e}") for each in values])


@pytest.mark.parametrize(("step_nm", "width_nm", "digits"), [(1.0, 45.0, 3), (0.1, 16.0, 4), (0.5, 30.0, 2)])
def test_a_smooth_peak_that_was_rounded_is_not_saturated(
    step_nm: float, width_nm: float, digits: int
) -> None:
    nm = np.arange(380.0, 780.0, step_nm)
    values = _hump(nm, width_nm, digits)
    require_spectrum(SpectralCurve.of(nm, values, unit=LIGHT.unit), "The instrument")
    clipped = SpectralCurve.of(nm, np.minimum(values, 0.0117), unit=LIGHT.unit)
    with pytest.raises(DeviceError, match="saturated"):
        require_spectrum(clipped, "The instrument")


def test_noise_where_an_instrument_is_hardly_sensitive_is_no_fault_of_the_light() -> None:
    nm = np.arange(200.0, 1100.0, 5.0)
    noise = np.where((nm < 330) | (nm > 950), 0.02 * (-1.0) ** np.arange(nm.size), 0.0)
    require_light(SpectralCurve.of(nm, _hump(nm, 40.0, 6) + noise, unit=LIGHT.unit), {}, "white", "It")


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        (np.zeros(61), "no value is above zero"),
        (LIGHT.at(NM) - 0.3, "it goes down to -0.29"),
        (LIGHT.at(NM), "it is the spectrum of green, value by value"),
    ],
)
def test_light_is_told_from_nonsense(values: Any, sentence: str) -> None:
    with pytest.raises(DeviceError, match=f"no spectrum of red: {sentence}"):
        require_light(SpectralCurve.of(NM, values), {"green": LIGHT}, "red", "The instrument")
    require_light(SpectralCurve.of(NM, 2 * LIGHT.at(NM)), {"green": LIGHT}, "red", "The instrument")

"""The specbos against an emulator in memory: spectra, refusals, and every fault that must not be believed."""

from __future__ import annotations

import pytest

from dsl_core.devices.base import Spectroradiometer
from dsl_core.devices.conformance import SpectroradiometerConformance
from dsl_core.devices.drivers.jeti_specbos import BAUDS, JetiSettings, JetiSpecbos, open_jeti
from dsl_core.devices.drivers.serial_line import SerialLine
from dsl_core.errors import DeviceError
from tests.devices.emulators.jeti import JETI_FAULTS, Jeti, radiance
from tests.devices.emulators.ports import FAULTS, FakePort, Faulty, Instrument, ends


def jeti(inner: Instrument, **settings: object) -> JetiSpecbos:
    def connect(port: str, name: str, baud: int) -> SerialLine:
        memory = FakePort(inner)
        return SerialLine(memory, name, memory.clock)

    return open_jeti(JetiSettings.model_validate({"port": "COM5", **settings}), connect)


class TestJeti(SpectroradiometerConformance):
    def open_spectroradiometer(self) -> Spectroradiometer:
        return jeti(Jeti())


def test_radiance_is_read_over_the_whole_range() -> None:
    inner = Jeti()
    with jeti(inner, average=3, cycle_us=16667) as instrument:
        curve = instrument.measure()
    assert curve.wavelengths_nm == tuple(float(nm) for nm in range(380, 781))
    assert curve.values[170] == pytest.approx(radiance(550), rel=1e-6)
    assert {"*CONF:WRAN 380 780 1", "*CONF:AVER 3", "*CONF:CYCMOD 1", "*CONF:CYCTIM 16667"} <= set(
        inner.settings
    )


def test_the_speed_of_the_port_is_found() -> None:
    tried = []

    def connect(port: str, name: str, baud: int) -> SerialLine:
        tried.append(baud)
        inner: Instrument = Jeti() if baud == 115_200 else Faulty(Jeti(), "rubbish", 1, 4)
        memory = FakePort(inner)
        return SerialLine(memory, name, memory.clock)

    open_jeti(JetiSettings(port="COM5"), connect).close()
    assert tried == list(BAUDS[:2])


@pytest.mark.parametrize(
    ("fault", "told"),
    [
        ("refuses", r"refused '\*CONF:AVER 1' .121."),
        ("never done", "did not finish a measurement"),
        ("diffuser", "head for irradiance .diffuser.; radiance is needed"),
        ("wrong range", "without two copies that agree"),
        ("no light", "refused to measure .121."),
        ("other maker", "answers 'ACME_100'"),
        ("not finite", "without two copies that agree"),
    ],
)
def test_what_is_no_radiance_is_refused(fault: str, told: str) -> None:
    with pytest.raises(DeviceError, match=told):
        jeti(Jeti(fault)).measure()


@pytest.mark.parametrize("fault", [*FAULTS, *JETI_FAULTS])
def test_no_fault_is_believed(fault: str) -> None:
    def measured(line: Instrument) -> float:
        curve = jeti(line).measure()
        return max(abs(v - radiance(nm)) for nm, v in zip(curve.wavelengths_nm, curve.values, strict=True))

    for seed in range(3):
        inner = Jeti(fault if fault in JETI_FAULTS else "")
        line = inner if fault in JETI_FAULTS else Faulty(inner, fault, 1 + 4 * seed, seed)
        ending = ends(lambda line=line: measured(line), lambda off: (1.0 if off is None else off) < 1e-7)  # type: ignore[misc]
        assert ending in ("right", "stopped"), f"{fault}, seed {seed}"

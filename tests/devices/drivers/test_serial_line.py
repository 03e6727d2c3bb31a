"""A port that cannot be opened is told with the ports that there are."""

from __future__ import annotations

import errno
import sys
from types import ModuleType, SimpleNamespace

import pytest

from dsl_core.devices.drivers.serial_line import open_line
from dsl_core.errors import DeviceError


@pytest.mark.parametrize(
    ("there", "said"),
    [(["COM3", "COM4"], "serial ports are: COM3, COM4"), ([], "This computer has no serial port")],
)
def test_a_missing_port_is_told_with_those_there_are(
    monkeypatch: pytest.MonkeyPatch, there: list[str], said: str
) -> None:
    def refuse(port: str, *_: object, **__: object) -> None:
        raise OSError(errno.ENOENT, f"could not open port {port}: [Errno 2] No such file: {port}")

    names = ("serial", "serial.tools", "serial.tools.list_ports")
    serial, tools, ports = modules = [ModuleType(name) for name in names]
    listed = [SimpleNamespace(device=each, description="", vid=None) for each in there]
    vars(serial)["Serial"], vars(ports)["comports"], vars(tools)["list_ports"] = refuse, lambda: listed, ports
    for name, module in zip(names, modules, strict=True):
        monkeypatch.setitem(sys.modules, name, module)
    with pytest.raises(DeviceError, match=f"The stage cannot be opened: No such file or directory. .*{said}"):
        open_line("COM9", "The stage", 9600)

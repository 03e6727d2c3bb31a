"""Headless engine of dsl-scan: Dispersed Structured Light without a window.

What a script needs is here, and loads when it is first used::

    import dsl_core as dsl

    with dsl.open_rig("twin", size="222x145") as rig:
        scan = dsl.scan(rig, "first.dsl", dsl.plan(rig, "quick"))
    result = dsl.reconstruct(scan)
    result.dsl.plot(x=110, y=70)

Results are `xarray.Dataset`; the accessor ``.dsl`` adds spectra with their bands, reasons, the verdict and
exports.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from dsl_core.version import __version__

if TYPE_CHECKING:
    from dsl_core.api.answers import classify as classify
    from dsl_core.api.answers import colours as colours
    from dsl_core.api.arrays import calibrate_geometry as calibrate_geometry
    from dsl_core.api.arrays import decode_stack as decode_stack
    from dsl_core.api.arrays import depth_of_columns as depth_of_columns
    from dsl_core.api.arrays import read_spectra as read_spectra
    from dsl_core.api.results import evaluate as evaluate
    from dsl_core.api.results import export as export
    from dsl_core.api.results import load_result as load_result
    from dsl_core.api.results import save_result as save_result
    from dsl_core.api.scans import load_calibration as load_calibration
    from dsl_core.api.scans import load_scan as load_scan
    from dsl_core.api.scans import open_rig as open_rig
    from dsl_core.api.scans import plan as plan
    from dsl_core.api.scans import predict as predict
    from dsl_core.api.scans import reconstruct as reconstruct
    from dsl_core.api.scans import rigs as rigs
    from dsl_core.api.scans import scan as scan

_SCANS = ("load_calibration", "load_scan", "open_rig", "plan", "predict", "reconstruct", "rigs", "scan")
_RESULTS = ("evaluate", "export", "load_result", "save_result")
_ANSWERS = ("classify", "colours")
_ARRAYS = ("calibrate_geometry", "decode_stack", "depth_of_columns", "read_spectra")
#: The module of each public name.
_HOMES = (
    dict.fromkeys(_SCANS, "dsl_core.api.scans")
    | dict.fromkeys(_RESULTS, "dsl_core.api.results")
    | dict.fromkeys(_ANSWERS, "dsl_core.api.answers")
    | dict.fromkeys(_ARRAYS, "dsl_core.api.arrays")
)

__all__ = [
    "__version__",
    "calibrate_geometry",
    "classify",
    "colours",
    "decode_stack",
    "depth_of_columns",
    "evaluate",
    "export",
    "load_calibration",
    "load_result",
    "load_scan",
    "open_rig",
    "plan",
    "predict",
    "read_spectra",
    "reconstruct",
    "rigs",
    "save_result",
    "scan",
]


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    # What else is here serves the package alone.
    return sorted({*__all__, *(name for name in globals() if name.startswith("__"))})

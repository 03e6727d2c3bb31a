"""Import and export of the published layout of DSL scans and calibrations.

Names and shapes are facts from the public repository of S. Shin, S. Choi, F. Heide, S.-H. Baek, Dispersed
Structured Light for Hyperspectral 3D Imaging, CVPR 2024 (README, ``ArgParser.py`` and the readers of each
file); the calibration file's names go back to kamino410/procam-calibration, a third dialect is that of
D. Moreno and G. Taubin's calibration software (3DIMPVT 2012). No code of theirs is used.
"""

from __future__ import annotations

from dsl_core.io.published.calibration import (
    PublishedCalibration,
    PublishedTables,
    check_calibration,
    export_calibration,
    holds_calibration,
    load_calibration,
    load_tables,
    save_tables,
)
from dsl_core.io.published.dataset import (
    PUBLISHED_SETTINGS,
    PublishedScan,
    export_dataset,
    open_dataset,
)
from dsl_core.io.published.layout import FileRecord, check_dataset
from dsl_core.io.published.stereo import Stereo, load_stereo, save_stereo

__all__ = [
    "PUBLISHED_SETTINGS",
    "FileRecord",
    "PublishedCalibration",
    "PublishedScan",
    "PublishedTables",
    "Stereo",
    "check_calibration",
    "check_dataset",
    "export_calibration",
    "export_dataset",
    "holds_calibration",
    "load_calibration",
    "load_stereo",
    "load_tables",
    "open_dataset",
    "save_stereo",
    "save_tables",
]

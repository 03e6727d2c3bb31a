"""Make the finished scans that come with the program: ``python packaging/make_examples.py WORK``.

Scans each scene on the twin with the reference plan at 445 x 290 into the folder WORK (some minutes; a scan
that is there is resumed), reconstructs it, rounds its numbers well below their uncertainty, so that they
compress, and replaces ``resources/examples``. Run it again when the schema of results changes, or when their
numbers improve.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import dsl_core as dsl

if TYPE_CHECKING:
    import xarray as xr

SCENES = ("color-checker", "face")
SIZE = "445x290"
TARGET = Path(__file__).parents[1] / "resources" / "examples"
#: Steps to which variables are rounded; reflectance is unsure by 0.004 and more.
STEPS = {
    "reflectance": 1e-3,
    "data_share": 0.04,
    "points_mm": 2**-6,
    "depth_mm": 2**-6,
    "normals": 2**-9,
    "shading": 2**-10,
    "rgb": 2**-8,
    "column_px": 2**-9,
}
#: Binary digits that are kept of standard deviations: 3 %.
DIGITS = {"reflectance_std": 4, "depth_std_mm": 5, "column_std_px": 5}
#: Attributes that are of the computer on which the scan was made.
LEFT_OUT = ("scanned_on", "stage_costs")


def rounded(result: xr.Dataset) -> xr.Dataset:
    """The result with numbers that compress well, and a note of that."""
    result = result.load().copy(deep=True)
    for name, step in STEPS.items():
        result[name].values[...] = np.rint(result[name].values / step) * step
    for name, digits in DIGITS.items():
        mantissa, exponent = np.frexp(result[name].values)
        result[name].values[...] = np.ldexp(np.rint(mantissa * 2**digits) / 2**digits, exponent)
    for name in LEFT_OUT:
        result.attrs.pop(name, None)
    note = "An example that comes with the program; reflectance is rounded to 0.001, deviations to 3 %."
    return result.assign_attrs(example=note)


def main() -> None:
    """Make all examples."""
    work = Path(sys.argv[1])
    for scene in SCENES:
        with dsl.open_rig("twin", scene=scene, size=SIZE) as rig:
            scan = dsl.scan(rig, work / f"{scene}.dsl")
        made = dsl.save_result(rounded(dsl.reconstruct(scan)), TARGET / f"{scene}.zarr", overwrite=True)
        size = sum(path.stat().st_size for path in made.rglob("*") if path.is_file())
        print(f"{made}: {size / 1e6:.1f} MB")


if __name__ == "__main__":
    main()

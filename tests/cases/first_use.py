"""Make what the first use of a new environment makes: the bytecode of all that is imported, compiled loops.

``python -m tests.cases.first_use`` imports every module, scans a small scene and reconstructs it. Otherwise
each process of the tests makes all of that for itself, at the same time as the others.
"""

from __future__ import annotations

import importlib
import os
import pkgutil
import tempfile
from types import ModuleType

import dsl_app

import dsl_core
from tests.cases.tiny_campaign import Ending, give

#: The loops that solve are compiled for few, more and many bands that a line reaches.
BANDS = ("430:660:5", "430:660:2.5", "430:660:2")


def import_all(package: ModuleType) -> None:
    """Import every module of a package."""
    for found in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
        if not found.name.endswith("__main__"):
            importlib.import_module(found.name)


def scan_and_reconstruct(folder: str) -> Ending:
    """Scan and reconstruct the smallest scene that every loop over pixels works on."""
    scan, result = os.path.join(folder, "scan.dsl"), os.path.join(folder, "scan.zarr")
    ending = give("scan", scan, "--plan", "coarse", "--option", "size=48x32")
    for bands in BANDS:
        if ending.code == 0:
            ending = give("reconstruct", scan, "--output", result, "--force", "--bands", bands)
    return ending


def main() -> int:
    """Do both; the exit code is that of the scan or the reconstruction."""
    import_all(dsl_core)
    import_all(dsl_app)
    with tempfile.TemporaryDirectory() as folder:
        ending = scan_and_reconstruct(folder)
    if ending.code:
        print(ending.err)
    return ending.code


if __name__ == "__main__":
    raise SystemExit(main())

"""Parts of the program that are installed on request, and the sentence where one is missing."""

from __future__ import annotations

import functools
from collections.abc import Callable
from importlib.util import find_spec
from typing import ParamSpec, TypeVar

from dsl_core.errors import MissingPackageError

P = ParamSpec("P")
R = TypeVar("R")

#: The extra that brings a module which the core does without, and what it is for.
EXTRA_OF = {
    "torch": "reconstruct",
    "numba": "reconstruct",
    "cv2": "reconstruct",
    "distributed": "cluster",
    "obstore": "s3",
    "rawpy": "raw",
    "PySide6": "gui",
    "pyqtgraph": "gui",
    "pyvista": "gui",
    "shiboken6": "gui",
    "superqt": "gui",
    "vtk": "gui",
    "vtkmodules": "gui",
}
_PURPOSE = {
    "reconstruct": "depth and spectra from frames, the twin, calibration, planning, PNG files, webcams",
    "gui": "the window",
    "cluster": "batches on a cluster of Dask",
    "s3": "scans and results in an object store",
    "raw": "pictures as photographic cameras store them",
}


def pip_command(extra: str) -> str:
    """What installs an extra, in double quotes: Windows passes single ones on to pip.

    >>> pip_command("ocean")
    'pip install "dsl-scan[ocean]"'
    """
    return f'pip install "dsl-scan[{extra}]"'


def missing_package(error: ModuleNotFoundError) -> MissingPackageError | None:
    """What to install where a module of an extra is missing; None where another module is."""
    module = (error.name or "").partition(".")[0]
    extra = EXTRA_OF.get(module)
    if extra is None:
        return None
    return MissingPackageError(
        f"This needs the package {module}, which is not installed here. It comes with the extra {extra!r}"
        f" ({_PURPOSE[extra]}): {pip_command(extra)}"
    )


def require_package(module: str) -> None:
    """Raise `MissingPackageError` now where a package of an extra is missing that is imported only later."""
    missing = None if has_package(module) else missing_package(ModuleNotFoundError(name=module))
    if missing is not None:
        raise missing


def has_package(module: str) -> bool:
    """Whether a package is there; nothing is imported."""
    try:
        return find_spec(module) is not None
    except ModuleNotFoundError:
        return False


def names_missing_packages(function: Callable[P, R]) -> Callable[P, R]:
    """The function, which raises `MissingPackageError` where a package of an extra is missing."""

    @functools.wraps(function)
    def named(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return function(*args, **kwargs)
        except ModuleNotFoundError as error:
            missing = missing_package(error)
            if missing is None:
                raise
            raise missing from error

    return named

"""Results: loaded, saved, exported and compared with truth."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import dsl_core.api.accessor  # noqa: F401  (registers ``.dsl``)
from dsl_core.api import FilePath, path_of
from dsl_core.api.places import require_result
from dsl_core.extras import names_missing_packages
from dsl_core.io.export import export_by_ending
from dsl_core.io.result import result_file
from dsl_core.model.result_order import canonical

if TYPE_CHECKING:
    import xarray as xr

    from dsl_core.evaluation.summary import Evaluation


def load_result(path: FilePath) -> xr.Dataset:
    """A saved result; bands are read when they are first used. Raises `StoreError`."""
    return result_file.load_result(path_of(path))


def save_result(result: xr.Dataset, path: FilePath, *, overwrite: bool = False) -> Path:
    """Store a result as a zarr folder, whole or not at all, and return its path; raises `StoreError`."""
    require_result(result)
    return result_file.save_result(result, path_of(path), overwrite=overwrite)


@names_missing_packages
def export(
    result: xr.Dataset,
    path: FilePath,
    format: str | None = None,
    *,
    pixels: Sequence[tuple[int, int]] = (),
    overwrite: bool = False,
) -> list[Path]:
    """Write a result for another program and return the files written.

    ``format`` is csv, envi, exr, glb, npy, obj, ply, png, stl, tiff, or mesh for a surface as .ply; by
    default the ending of the path says it. csv is a table of the spectra of ``pixels``, (x, y) each in
    the picture; what ``result.dsl.spectrum`` and ``result.dsl.region`` return is exported as csv too.
    Raises `StoreError` for an unknown format, an existing file and a disk that fails.
    """
    require_result(result)
    return export_by_ending(result, path_of(path), format, pixels=pixels, overwrite=overwrite)


@names_missing_packages
def evaluate(result: xr.Dataset) -> Evaluation:
    """Errors and coverage of a result of the simulated rig, whose truth is known.

    Raises `DecodeError` for a result of another rig.
    """
    from dsl_core import pipeline
    from dsl_core.workflows.truths import truth_of

    require_result(result)
    result = canonical(result)
    return pipeline.evaluate(result, truth_of(result))

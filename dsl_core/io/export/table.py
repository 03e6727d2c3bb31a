"""A table of answers as CSV: lines that begin with ``#`` say where it comes from."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dsl_core.io.export.common import provenance, require_suffix
from dsl_core.io.export.wording import csv_line, figure_text, header_lines
from dsl_core.io.staging import staged

if TYPE_CHECKING:
    import xarray as xr


def export_table(
    result: xr.Dataset,
    header: Sequence[str],
    rows: Iterable[Sequence[object]],
    notes: Mapping[str, str],
    path: Path,
    *,
    overwrite: bool = False,
) -> list[Path]:
    """Write rows under a header, after ``notes`` and the origin of the result; None is an empty cell.

    Raises `StoreError`.
    """
    require_suffix(path, ".csv")
    with (
        staged([path], overwrite=overwrite) as (draft,),
        draft.open("w", newline="", encoding="utf-8") as file,
    ):
        file.writelines(header_lines({**notes, **provenance(result)}))
        file.write(csv_line(header))
        file.writelines(csv_line(map(_text, row)) for row in rows)
    return [path]


def _text(cell: object) -> object:
    if cell is None:
        return ""
    return figure_text(float(cell)) if isinstance(cell, float | np.floating) else cell

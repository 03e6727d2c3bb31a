"""How far two results are apart, of which neither is the truth."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dsl_core.cli.options import Json
from dsl_core.cli.output import Output


def compare(
    first: Annotated[Path, typer.Argument(help="A result, NAME.zarr.")],
    second: Annotated[Path, typer.Argument(help="The result to compare it with, of the same camera.")],
    json: Json = False,
) -> None:
    """Compare two results: FIRST minus SECOND over the pixels and bands that both have."""
    from dsl_core.evaluation.difference import compare_results, difference_table, figures, shared_bands
    from dsl_core.io.result.result_arrays import load_arrays

    output = Output(json)
    with output.progress() as progress:
        a, b = (load_arrays(path, progress) for path in (first, second))
        both = a.has_spectra and b.has_spectra
        bands = shared_bands(b.wavelengths_nm, a.wavelengths_nm) if both else []
        cubes = [side["reflectance"] if both else None for side in (b, a)]
        # The second is what the first is measured against.
        found = compare_results(b["depth_mm"], a["depth_mm"], cubes[0], cubes[1], bands, progress)
    rows = difference_table(found)
    output.table(("figure", "value", "unit"), [(row.figure, row.words, row.unit) for row in rows])
    output.put(
        first=first,
        second=second,
        figures={
            each.words: {"value": each.value, "std": each.std, "unit": each.unit} for each in figures(found)
        },
    )
    output.finish()

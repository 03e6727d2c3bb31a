"""Commands that compare results: with each other, along a stage, over seconds of capture."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dsl_core.cli.options import Force, Json, Report, parse_numbers, parse_region
from dsl_core.cli.output import Output
from dsl_core.io.staging import check_targets, write_text

if TYPE_CHECKING:
    from dsl_core.evaluation.report.series_page import Table

Results = Annotated[list[Path], typer.Argument(metavar="RESULT.zarr...", help="Results of 'reconstruct'.")]


def compare(
    first: Annotated[Path, typer.Argument(metavar="FIRST.zarr", help="A result.")],
    second: Annotated[
        Path,
        typer.Argument(metavar="SECOND.zarr", help="The result to compare it with, of the same camera."),
    ],
    json: Json = False,
) -> None:
    """Compare two results: FIRST minus SECOND over the pixels and bands that both have."""
    from dsl_core.evaluation.difference import (
        compare_results,
        difference_table,
        figures,
        require_same_places,
        shared_bands,
    )
    from dsl_core.io.result.result_arrays import load_arrays

    output = Output(json)
    with output.progress() as progress:
        a, b = (load_arrays(path, progress) for path in (first, second))
        require_same_places(a.places_px, b.places_px)
        a, b = a.averaged_like(b), b.averaged_like(a)
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
            words: {"value": value, "std": std, "unit": unit} for words, value, std, unit, _ in figures(found)
        },
    )
    output.finish()


def depth_test(
    results: Results,
    positions: Annotated[
        str | None,
        typer.Option(
            "--positions",
            help="Stage position of each result, mm, separated by commas, like 695.2,707,719. Otherwise taken"
            " from names like 'stage 695.2 mm.zarr', or from the twin's depth.",
        ),
    ] = None,
    region: Annotated[
        str | None, typer.Option("--region", help="X,Y,WIDTH,HEIGHT in px that the flat target fills.")
    ] = None,
    report: Report = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Test depth with a flat target at several stage positions: how flat and how straight the planes are."""
    from dsl_core.evaluation.report.series_page import stage_page, stage_rows
    from dsl_core.evaluation.stage_test import stage_table, stage_test
    from dsl_core.workflows.series import read_targets

    output = Output(json)
    given = None if positions is None else parse_numbers("--positions", positions)
    part = None if region is None else parse_region("--region", region)
    check_targets([] if report is None else [report], overwrite=force)
    with output.progress() as progress:
        targets, at = read_targets(results, given, part, progress)
    found, names = stage_test(at, targets), [path.stem for path in results]
    _tell(output, stage_rows(names, targets, found))
    output.say("")
    rows = stage_table(found)
    output.table(("figure", "value", "unit"), [(row.figure, row.words, row.unit) for row in rows])
    output.put(
        results=[str(path) for path in results],
        pixels=[target.plane.pixels for target in targets],
        left_out=[target.left_out for target in targets],
        rms_mm=[target.plane.rms_mm for target in targets],
        **asdict(found),
        straightness_mm={"slope_free": found.free.rms_mm, "slope_1": found.fixed.rms_mm},
    )
    if report is not None:
        output.put(report=write_text(report, lambda: stage_page(names, targets, found), overwrite=force))
        output.say(f"The report is saved in {report}")
    output.finish()


def sweep(
    results: Results,
    against: Annotated[
        Path | None,
        typer.Option(
            help="Result to compare with, such as that of the longest scan; the default is the twin's truth."
        ),
    ] = None,
    report: Report = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Compare scans of one scene: error against capture time, and which scans are worth theirs."""
    from dsl_core.evaluation.report.series_page import sweep_page, sweep_rows
    from dsl_core.evaluation.time_sweep import FIGURES, best_points
    from dsl_core.workflows.series import read_sweep

    output = Output(json)
    check_targets([] if report is None else [report], overwrite=force)
    with output.progress() as progress:
        points, reference = read_sweep(results, against, progress)
    output.say(f"Compared with {reference.name}; a star marks scans that no faster scan beats:")
    _tell(output, sweep_rows(points))
    output.put(
        reference=reference.name,
        points=[asdict(point) for point in points],
        best={each.field: [points[i].name for i in best_points(points, each)] for each in FIGURES},
    )
    if report is not None:
        output.put(report=write_text(report, lambda: sweep_page(points, reference.name), overwrite=force))
        output.say(f"The report is saved in {report}")
    output.finish()


def _tell(output: Output, table: Table) -> None:
    output.table(table.heads, table.rows)

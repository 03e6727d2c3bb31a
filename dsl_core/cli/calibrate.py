"""Commands that calibrate a rig: ``calibrate geometry``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dsl_core.cli.options import Force, Json, parse_size
from dsl_core.cli.output import Output
from dsl_core.errors import CalibrationError

if TYPE_CHECKING:
    from dsl_core.model.board import Charuco, Checkerboard
    from dsl_core.model.geometry_calibration import GeometryCalibration, PoseQuality
    from dsl_core.model.rig import BayerPattern

calibrate = typer.Typer(help="Calibrate a rig from pictures of targets.", no_args_is_help=True)


@calibrate.callback()
def _calibrate() -> None:
    """Calibrate a rig from pictures of targets."""


@calibrate.command()
def geometry(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="One folder of numbered pictures a pose.")],
    board: Annotated[str, typer.Option(help="COLUMNSxROWS of inner corners; with --marker-mm, of squares.")],
    square_mm: Annotated[float, typer.Option(help="Side of a printed square, measured.")],
    marker_mm: Annotated[float | None, typer.Option(help="Side of a marker: the board is a ChArUco.")] = None,
    dictionary: Annotated[str, typer.Option(help="Markers of a ChArUco board.")] = "DICT_5X5_100",
    projector: Annotated[str, typer.Option(help="WIDTHxHEIGHT of the projector, px.")] = "640x360",
    binning: Annotated[float, typer.Option(help="Sensor pixels a camera pixel spans along a side.")] = 1.0,
    bayer: Annotated[str | None, typer.Option(help="Mosaic of raw pictures: RGGB, BGGR, GRBG, GBRG.")] = None,
    baseline_mm: Annotated[
        float | None, typer.Option(help="Distance of camera and projector, to check the printed size.")
    ] = None,
    target: Annotated[Path | None, typer.Option("--output", "-o", help="GEOMETRY.json to write.")] = None,
    xml: Annotated[Path | None, typer.Option(help="Published XML or YAML to write.")] = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Find lenses and pose of camera and projector from a board under Gray code, film off."""
    from dsl_core import pipeline
    from dsl_core.io.geometry_file import as_stereo, save_geometry
    from dsl_core.io.published.stereo import save_stereo
    from dsl_core.io.staging import check_targets

    output = Output(json)
    files = [path for path in (target, xml) if path is not None]
    check_targets(files, overwrite=force)
    printed = _board(board, square_mm, marker_mm, dictionary)
    size, mosaic = parse_size("--projector", projector), _bayer(bayer)
    with output.progress() as progress:
        found = pipeline.calibrate_geometry(folder, printed, size, mosaic, binning, baseline_mm, progress)
    if target is not None:
        save_geometry(found, target, overwrite=force)
    if xml is not None:
        save_stereo(as_stereo(found), xml, overwrite=force)
    _print(output, found)
    output.say(f"Written: {', '.join(map(str, files))}" if files else "Nothing is written without --output.")
    output.put(calibration=found.model_dump(mode="json"), files=[str(path) for path in files])
    output.finish()


def _board(text: str, square_mm: float, marker_mm: float | None, dictionary: str) -> Checkerboard | Charuco:
    from pydantic import ValidationError

    from dsl_core.model.board import Charuco, Checkerboard

    columns, rows = parse_size("--board", text)
    try:
        if marker_mm is None:
            return Checkerboard(columns=columns, rows=rows, square_mm=square_mm)
        return Charuco(
            columns=columns, rows=rows, square_mm=square_mm, marker_mm=marker_mm, dictionary=dictionary
        )
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"])) or "board"
        raise CalibrationError(f"The board is impossible: {where}: {first['msg']}. Correct it.") from error


def _bayer(text: str | None) -> BayerPattern | None:
    match text:
        case None | "RGGB" | "BGGR" | "GRBG" | "GBRG":
            return text
    raise CalibrationError(f"--bayer must be RGGB, BGGR, GRBG or GBRG, not {text!r}. Leave it out for mono.")


def _print(output: Output, found: GeometryCalibration) -> None:
    lenses = (
        ("camera", found.camera, found.camera_deviation),
        ("projector", found.projector, found.projector_deviation),
    )
    names = ("fx_px", "fy_px", "cx_px", "cy_px")
    rows = [
        (what, *(f"{getattr(lens, name):.2f} ± {getattr(deviation, name):.2f}" for name in names))
        for what, lens, deviation in lenses
    ]
    output.table(("lens", "fx px", "fy px", "cx px", "cy px"), rows)
    headings = (
        "pose",
        "corners",
        "out",
        "camera px",
        "projector px",
        "tilt",
        "square mm",
        "plane mm",
        "unseen mm",
    )
    output.table(headings, [_row(pose) for pose in found.poses])
    output.say(
        f"Reprojection {found.rms_px:.3f} px rms (camera {found.camera_rms_px:.3f}, projector"
        f" {found.projector_rms_px:.3f}; {found.rms_with_outliers_px:.3f} with outliers);"
        f" {found.full_resolution_rms_px:.3f} px with unbinned camera pixels."
    )
    squares = found.squares
    output.say(
        f"Squares {squares.square_mm:.3f} ± {squares.square_std_mm:.3f} mm, printed"
        f" {found.board.square_mm:g} mm; planes to {found.plane_rms_share:.1e} of their distance."
    )
    for warning in found.warnings:
        output.say(f"Warning: {warning}")


def _row(pose: PoseQuality) -> tuple[object, ...]:
    unseen = "-" if pose.left_out is None else f"{pose.left_out.square_mm:.3f}"
    return (
        pose.name if pose.used else f"{pose.name} (left out)",
        pose.corners,
        pose.outliers,
        f"{pose.camera_rms_px:.3f}",
        f"{pose.projector_rms_px:.3f}",
        f"{pose.tilt_deg:.0f}°",
        f"{pose.measured.square_mm:.3f} ± {pose.measured.square_std_mm:.3f}",
        f"{pose.measured.plane_rms_mm:.3f}",
        unseen,
    )

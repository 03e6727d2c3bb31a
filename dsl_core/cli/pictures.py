"""``calibrate geometry --pictures``: lenses and pose from pictures that another program took."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from dsl_core.cli.options import parse_size
from dsl_core.cli.output import Output
from dsl_core.errors import CalibrationError
from dsl_core.io.staging import check_targets

if TYPE_CHECKING:
    from dsl_core.model.board import Charuco, Checkerboard
    from dsl_core.model.calibration.geometry import GeometryCalibration, PoseQuality
    from dsl_core.model.rig import BayerPattern


@dataclass(frozen=True)
class BoardOptions:
    """The printed board that the options describe."""

    board: str | None
    square_mm: float | None
    marker_mm: float | None
    dictionary: str

    def build(self) -> Checkerboard | Charuco | None:
        """The board, None without these options; raises `CalibrationError` when it is impossible."""
        if self.board is None and self.square_mm is None and self.marker_mm is None:
            return None
        if self.board is None or self.square_mm is None:
            raise CalibrationError("A board needs both --board COLUMNSxROWS and --square-mm. Give both.")
        return _board(self.board, self.square_mm, self.marker_mm, self.dictionary)


@dataclass(frozen=True)
class PictureOptions:
    """The pictures that the options describe, and where to write the outcome."""

    projector: str
    binning: float
    bayer: str | None
    baseline_mm: float | None
    target: Path | None
    xml: Path | None
    force: bool


def calibrate_pictures(output: Output, folder: Path, board: BoardOptions, options: PictureOptions) -> None:
    """Calibrate from a folder of pose folders, print what was found and write the files requested."""
    from dsl_core.io.published.stereo import save_stereo, stereo_of
    from dsl_core.io.records import write_record
    from dsl_core.workflows.pictures import calibrate_geometry

    files = [path for path in (options.target, options.xml) if path is not None]
    check_targets(files, overwrite=options.force)
    printed = board.build()
    if printed is None:
        raise CalibrationError("Pictures need --board COLUMNSxROWS and --square-mm of the printed board.")
    size, mosaic = parse_size("--projector", options.projector), _bayer(options.bayer)
    with output.progress() as progress:
        found = calibrate_geometry(
            folder, printed, size, mosaic, options.binning, options.baseline_mm, progress
        )
    if options.target is not None:
        write_record(options.target, found, overwrite=options.force)
    if options.xml is not None:
        save_stereo(stereo_of(found), options.xml, overwrite=options.force)
    print_geometry(output, found)
    output.say(
        f"Written: {', '.join(map(str, files))}" if files else "Nothing was written: --output is not given."
    )
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
    raise CalibrationError(
        f"--bayer must be RGGB, BGGR, GRBG or GBRG, not {text!r}. Leave it out for a monochrome camera."
    )


def print_geometry(output: Output, found: GeometryCalibration) -> None:
    """Lenses, poses and residuals, for a person."""
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
        f"Reprojection {found.rms_px:.3f} px RMS (camera {found.camera_rms_px:.3f}, projector"
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

"""``calibrate geometry --pictures``: lenses and pose from pictures that another program took."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from dsl_core.cli.options import parse_size
from dsl_core.cli.output import Output
from dsl_core.errors import CalibrationError
from dsl_core.io.staging import check_targets

if TYPE_CHECKING:
    from dsl_core.io.pictures.mapping import Mapping
    from dsl_core.model.board import Charuco, Checkerboard
    from dsl_core.model.calibration.geometry import GeometryCalibration, PoseQuality
    from dsl_core.model.rig import BayerPattern


def board_of(
    text: str | None, square_mm: float | None, marker_mm: float | None, dictionary: str
) -> Checkerboard | Charuco | None:
    """The printed board that options describe, None without them; raises `CalibrationError`."""
    from pydantic import ValidationError

    from dsl_core.model.base import problems_in_words
    from dsl_core.model.board import Charuco, Checkerboard

    if text is None and square_mm is None and marker_mm is None:
        return None
    if text is None or square_mm is None:
        raise CalibrationError("A board needs both --board COLUMNSxROWS and --square-mm. Give both.")
    columns, rows = parse_size("--board", text, "COLUMNSxROWS", "whole numbers")
    try:
        if marker_mm is None:
            return Checkerboard(columns=columns, rows=rows, square_mm=square_mm)
        return Charuco(
            columns=columns, rows=rows, square_mm=square_mm, marker_mm=marker_mm, dictionary=dictionary
        )
    except ValidationError as error:
        raise CalibrationError(f"The board is impossible: {problems_in_words(error)}. Correct it.") from error


def calibrate_pictures(
    output: Output,
    folder: Path,
    board: Checkerboard | Charuco | None,
    projector: str,
    binning: float,
    bayer: str | None,
    baseline_mm: float | None,
    targets: tuple[Path | None, Path | None],
    layout: tuple[bool, Path | None],
    hold: list[str],
    force: bool,
) -> None:
    """Calibrate from a folder of pose folders, print what was found and write the files requested.

    ``targets`` are those of the record and of the published XML or YAML. ``layout`` says whether what the
    pictures show is to be guessed, and names a mapping that says it. Terms of distortion in ``hold`` are
    zero.
    """
    from dsl_core.io.published.stereo import save_stereo, stereo_of
    from dsl_core.io.records import write_record
    from dsl_core.workflows.pictures import calibrate_geometry

    record, xml = targets
    files = [path for path in targets if path is not None]
    check_targets(files, overwrite=force)
    if board is None:
        raise CalibrationError("Pictures need --board COLUMNSxROWS and --square-mm of the printed board.")
    size, mosaic = parse_size("--projector", projector), _bayer(bayer)
    mapping = _mapping_of(output, folder, size, *layout)
    if mapping is not None:
        size = mapping.projector_size_px
    with output.progress() as progress:
        found = calibrate_geometry(folder, board, size, mosaic, binning, baseline_mm, progress, mapping, hold)
    if record is not None:
        write_record(record, found, overwrite=force)
    if xml is not None:
        save_stereo(stereo_of(found), xml, overwrite=force)
    print_geometry(output, found)
    output.say(
        f"Written: {', '.join(map(str, files))}" if files else "Nothing was written: --output is not given."
    )
    output.put(calibration=found.model_dump(mode="json"), files=[str(path) for path in files])
    output.finish()


def calibrate_camera_pictures(
    output: Output,
    folder: Path,
    board: Checkerboard | Charuco | None,
    bayer: str | None,
    hold: list[str],
) -> None:
    """Find the lens of a camera alone from pictures of a board, and print it."""
    from dsl_core.workflows.pictures import calibrate_camera_alone

    if board is None:
        raise CalibrationError("Pictures need --board COLUMNSxROWS and --square-mm of the printed board.")
    with output.progress() as progress:
        found = calibrate_camera_alone(folder, board, _bayer(bayer), hold, progress)
    lens, deviation = found.lens, found.deviation
    names = ("fx_px", "fy_px", "cx_px", "cy_px")
    values = [(name, getattr(lens, name), getattr(deviation, name)) for name in names]
    terms = zip(("k1", "k2", "p1", "p2", "k3"), lens.distortion, deviation.distortion, strict=True)
    output.table(
        ("camera", "value", "deviation"),
        [(name.replace("_", " "), f"{value:.2f}", f"{std:.2g}") for name, value, std in values]
        + [(name, f"{value:.4f}", f"{std:.2g}") for name, value, std in terms],
    )
    output.table(
        ("picture", "corners", "error px"),
        [(name, corners, f"{error:.3f}") for name, corners, error in found.pictures],
    )
    output.say(f"Reprojection {found.rms_px:.3f} px RMS; corners cover {found.coverage:.0%} of the picture.")
    for warning in found.warnings:
        output.say(f"Warning: {warning}")
    output.put(
        camera=lens.model_dump(mode="json"),
        camera_deviation=deviation.model_dump(mode="json"),
        rms_px=round(found.rms_px, 4),
        warnings=list(found.warnings),
    )
    output.finish()


def _mapping_of(
    output: Output, folder: Path, size_px: tuple[int, int], guess: bool, path: Path | None
) -> Mapping | None:
    """What the pictures of each pose show, None for the usual order; says what was guessed or is unsure."""
    from dsl_core.workflows.captures import load_mapping
    from dsl_core.workflows.mapped_poses import guess_poses
    from dsl_core.workflows.pictures import pose_folders

    if guess and path is not None:
        raise CalibrationError("--guess finds out what --mapping states. Give one of them.")
    if path is not None:
        mapping = load_mapping(path)
    elif guess:
        folders = pose_folders(folder)
        mapping = guess_poses(folders, size_px).mapping
        output.say(f"Guessed from {folders[0].name}: {words_of(mapping)}.")
    else:
        return None
    for sentence in mapping.unsure:
        output.say(f"Unsure: {sentence}.")
    output.put(mapping=mapping.model_dump(mode="json"))
    return mapping


def words_of(mapping: Mapping) -> str:
    """The parts of a mapping in their order, in a few words each."""
    words = []
    for part in mapping.parts:
        match part.kind:
            case "stripes":
                inverse = "" if part.inverse == "none" else f", inverses {part.inverse}"
                words.append(
                    f"{part.bits} bits of {part.axis} ({part.code}, {part.first} significant first{inverse})"
                )
            case "phases":
                words.append(f"{len(part.fringes)} sinusoids of {part.axis} in {part.steps} steps")
            case "skip":
                words.append(f"{part.count} not used")
            case _:
                words.append(part.kind)
    return "; ".join(words)


def _bayer(text: str | None) -> BayerPattern | None:
    match text:
        case None | "RGGB" | "BGGR" | "GRBG" | "GBRG":
            return text
    raise CalibrationError(
        f"--bayer must be RGGB, BGGR, GRBG or GBRG, not {text!r}. Leave it out for a monochrome camera."
    )


def print_geometry(output: Output, found: GeometryCalibration) -> None:
    """Lenses, poses and residuals, for a person."""
    from dsl_core.model.figure import with_std

    lenses = (
        ("camera", found.camera, found.camera_deviation),
        ("projector", found.projector, found.projector_deviation),
    )
    names = ("fx_px", "fy_px", "cx_px", "cy_px")
    rows = [
        (what, *(with_std(getattr(lens, name), getattr(deviation, name), 2) for name in names))
        for what, lens, deviation in lenses
    ]
    if found.columns_only:
        rows[1] = (*rows[1][:2], f"{rows[1][2]} assumed", rows[1][3], f"{rows[1][4]} assumed")
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
        f"Squares {with_std(squares.square_mm, squares.square_std_mm, 3)} mm, printed"
        f" {found.board.square_mm:g} mm; planes to {found.shape_rms_share:.1e} of their distance."
    )
    for warning in found.warnings:
        output.say(f"Warning: {warning}")


def _row(pose: PoseQuality) -> tuple[object, ...]:
    from dsl_core.model.figure import with_std

    unseen = "-" if pose.left_out is None else f"{pose.left_out.square_mm:.3f}"
    return (
        pose.name if pose.used else f"{pose.name} (left out)",
        pose.corners,
        pose.outliers,
        f"{pose.camera_rms_px:.3f}",
        f"{pose.projector_rms_px:.3f}",
        f"{pose.tilt_deg:.0f}°",
        with_std(pose.measured.square_mm, pose.measured.square_std_mm, 3),
        f"{pose.measured.plane_rms_mm:.3f}",
        unseen,
    )

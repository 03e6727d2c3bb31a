"""What a worker finds out about a folder of pictures: a guess, what fits, how it decodes. No Qt."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dsl_app.importing.captures.fields import first_mapping
from dsl_app.importing.captures.state import (
    NO_FILE,
    NOMINAL,
    NONE,
    CaptureRequest,
    Decoded,
    Listing,
    Place,
    Size,
    Stated,
    checks_of,
)
from dsl_app.shared.notify import sentence_of
from dsl_app.shared.paths import is_file
from dsl_core.errors import CalibrationError, DslError
from dsl_core.io.pictures.mapping import Mapping
from dsl_core.progress import NoProgress, Progress

if TYPE_CHECKING:
    from dsl_core.io.calibration_library import CalibrationLibrary
    from dsl_core.model.rig import Rig

#: Small pictures: how many, and how wide, px.
SMALL_COUNT, SMALL_PX = 24, 56


@dataclass(frozen=True)
class Guessed:
    """A guess, or in its place a mapping to begin with; ``trouble`` is why, or what a person must state."""

    stated: Stated
    sets: tuple[str, ...]
    trouble: str = ""


def guess(request: CaptureRequest, progress: Progress) -> Guessed:
    """Find out what the pictures of a folder are; raises `StoreError` when it contains no pictures."""
    from dsl_core.io.pictures.guess import guess_mapping

    assert request.folder is not None
    size = request.projector_px if all(request.projector_px) else None
    try:
        found = guess_mapping(request.folder, size, request.chosen or None, progress)
    except DslError as error:
        pictures = _count(request.folder)
        if not pictures:
            raise
        mapping = first_mapping(pictures, request.projector_px)
        return Guessed(Stated(mapping), (), sentence_of(error))
    asks = f"{found.asks}. Set Unit of the stripes and Fringes of the sinusoids." if found.asks else ""
    return Guessed(Stated(found.mapping, is_guessed=True), (found.mapping.name, *found.others), asks)


def _count(folder: Path) -> int:
    from dsl_core.io.pictures.arrange import picture_files
    from dsl_core.io.pictures.picture_file import pictures_in

    try:
        return sum(len(pictures_in(path)) for path in picture_files(folder, ("*",)))
    except DslError:
        return 0


def list_files(request: CaptureRequest, mapping: Mapping, library: CalibrationLibrary) -> Listing:
    """What each file shows by a mapping, and whether mapping and calibration fit the pictures."""
    from dsl_core.io.pictures.arrange import arrange, draft_table
    from dsl_core.io.pictures.source import open_pictures

    assert request.folder is not None
    try:
        table = arrange(request.folder, mapping).table
        camera_px = open_pictures(request.folder, mapping).plan.camera_size_px
    except DslError as error:
        folder = request.folder
        return Listing(_whatever(lambda: draft_table(folder, mapping)), "", _one(Place.MAPPING, error))
    try:
        rig, told = rig_of(request, mapping, camera_px, library)
        require_sizes(rig, mapping, camera_px)
    except DslError as error:
        return Listing(table, "", _one(Place.CALIBRATION, error))
    return Listing(table, told, camera_px=camera_px)


def _whatever(make: Callable[[], tuple[tuple[str, str], ...]]) -> tuple[tuple[str, str], ...]:
    try:
        return make()
    except DslError:
        return ()


def _one(place: Place, error: Exception) -> tuple[tuple[Place, str], ...]:
    return ((place, sentence_of(error)),)


# Calibration ---------------------------------------------------------------------------------------


def rig_of(
    request: CaptureRequest, mapping: Mapping, camera_px: Size, library: CalibrationLibrary
) -> tuple[Rig | None, str]:
    """The rig to use and what to know about it; raises what its reader raises, naming what is missing."""
    from dsl_core.io.calibration_library import load_calibration
    from dsl_core.simulation.published_rig import published_rig

    chosen = request.calibration
    if chosen == NONE:
        return None, "Without a calibration the scan has columns and no depth; one can be given later."
    if chosen == NOMINAL:
        return published_rig(), "The rig of the publication, as it was designed: depth is approximate."
    if is_file(Path(chosen)) and not _is_rig(Path(chosen)):
        return _stereo(Path(chosen), request, camera_px, mapping.projector_size_px)
    rig = load_calibration(chosen, library)
    return rig, f"{rig.name}: {_distance(rig)}."


def _is_rig(path: Path) -> bool:
    from dsl_core.io.reading import read_json

    try:
        content = read_json(path)
    except (OSError, ValueError):
        return False
    return isinstance(content, dict) and bool({"film", "response", "rig"} & set(content))


def _stereo(path: Path, request: CaptureRequest, camera_px: Size, projector_px: Size) -> tuple[Rig, str]:
    from dsl_core.io.published.any_stereo import load_any_stereo
    from dsl_core.io.published.curves import load_curves
    from dsl_core.io.published.stereo_rig import lenses_on
    from dsl_core.io.published.stereo_words import placed
    from dsl_core.simulation.published_rig import published_rig

    # The box has 1 mm until somebody sets another unit; a file that states its own is read in that.
    unit_mm = None if request.unit_mm == 1 else request.unit_mm
    found = load_any_stereo(path, camera_px, projector_px, unit_mm, request.from_projector)
    tables = ("camera", request.camera_curves), ("LEDs", request.led_curves)
    curves = [None if table is None else load_curves(table, device) for device, table in tables]
    rig = lenses_on(published_rig(), found, path.name, *curves)
    said = [*checks_of(found.doubts), f"{path.name}: {placed(found.stereo)}."]
    said += [f"Missing, so assumed: {', '.join(found.assumed)}."] if found.assumed else []
    taken = [*found.taken, *(each.words for each in curves if each is not None)]
    said.append(f"Understood: {'; '.join(taken)}.")
    return rig, " ".join([*said, "For depth alone: it has no curves." if None in curves else "For depth."])


def _distance(rig: Rig) -> str:
    distance_mm = float(np.linalg.norm(rig.pose.vector_mm))
    return f"the projector is {distance_mm:.4g} mm from the camera"


def require_sizes(rig: Rig | None, mapping: Mapping, camera_px: Size) -> None:
    """Raise `CalibrationError` when a rig has other sizes than pictures or projector of the mapping."""
    if rig is None:
        return
    for what, given, device in (
        ("The pictures are", camera_px, rig.camera),
        ("The projector of the mapping is", mapping.projector_size_px, rig.projector),
    ):
        size = device.width_px, device.height_px
        if tuple(given) != size:
            raise CalibrationError(
                f"{what} {given[0]} × {given[1]} px; the calibration {rig.name!r} is for"
                f" {size[0]} × {size[1]} px. Choose the calibration of these pictures, or none."
            )


# Pictures ------------------------------------------------------------------------------------------


def small_pictures(
    folder: Path, mapping: Mapping, table: Sequence[tuple[str, str]]
) -> dict[str, NDArray[np.uint8]]:
    """Small pictures (rows, columns, 3) of the first files of a table by their names, all equally bright."""
    from dsl_core.io.pictures.picture_file import Picture, load_values

    thinned = {}
    for name, _ in table[:SMALL_COUNT]:
        # Pictures of one array are told apart by their place in it. No file of pictures ends with a bracket.
        one = re.fullmatch(r"(.+)\[(\d+)\]", name)
        picture = Picture(folder / name) if one is None else Picture(folder / one[1], int(one[2]))
        if name != NO_FILE:
            thinned[name] = _thin(load_values(picture, mapping.raw))
    top = max((float(np.percentile(each, 99.5)) for each in thinned.values()), default=0.0) or 1.0
    return {name: _bytes(each, top) for name, each in thinned.items()}


def _thin(values: NDArray[Any]) -> NDArray[np.float32]:
    step = max(values.shape[1] // SMALL_PX, 1)
    return np.asarray(values[::step, ::step], np.float32)


def _bytes(values: NDArray[np.float32], top: float) -> NDArray[np.uint8]:
    level = (values / top).clip(0, 1) * 255
    colour = level if level.ndim == 3 else np.repeat(level[..., None], 3, axis=2)
    return np.ascontiguousarray(colour.astype(np.uint8))


def decode(folder: Path, mapping: Mapping, progress: Progress | None = None) -> Decoded:
    """Columns of some of the pixels; raises `StoreError` naming the picture that cannot be used."""
    from dsl_core.io.pictures.encoding import encoding_of
    from dsl_core.io.pictures.source import open_pictures
    from dsl_core.workflows.captures import decode_columns_of, sensor_of
    from dsl_core.workflows.thinned import thinned as some_pixels

    source = open_pictures(folder, mapping)
    thinned = some_pixels(source)
    found = decoded_of(decode_columns_of(thinned, sensor_of(source), progress or NoProgress()))
    linearity, advice = encoding_of(source, thinned)
    return replace(found, values=linearity.sentence if linearity.figures else "", advice=advice)


def decoded_of(result: Any) -> Decoded:
    """What a decoded result shows: columns, and how many of the lit pixels have one."""
    from dsl_core.model.result import Flag

    column = np.asarray(result["column_px"].values, np.float32)
    lit = (result["flags"].values & int(Flag.NO_LIGHT)) == 0
    share = float(np.isfinite(column[lit]).mean()) if lit.any() else 0.0
    return Decoded(column, share, float(lit.mean()))

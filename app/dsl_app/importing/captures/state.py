"""A folder of pictures that is to become a scan: what they seem to be, and how to import them. No Qt."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dsl_app.shared.evented import Event, Value
from dsl_app.shared.paths import place_trouble, there
from dsl_app.shared.wording import in_window
from dsl_core.io.pictures.mapping import Mapping
from dsl_core.words import counted, sentence

#: Keys of calibrations that are neither in the library nor files.
NONE, NOMINAL = "", ":nominal"
SUFFIX = ".dsl"
#: Name in the table of a picture that there is none of.
NO_FILE = "-"
#: Begins what is told of a calibration that may not be meant like that.
DOUBT = "Check: "
#: Files of other programs with lenses and pose; rig files of this program end in .json, too.
STEREO_SUFFIXES = (".xml", ".yml", ".yaml", ".json")
Size = tuple[int, int]


class Place(Enum):
    """The part of the dialog that a sentence is about."""

    FOLDER = "folder"
    MAPPING = "mapping"
    CALIBRATION = "calibration"
    TARGET = "target"


@dataclass(frozen=True)
class CaptureRequest:
    """How to import: ``calibration`` is `NONE`, `NOMINAL`, a name of the library or the path of a file.

    ``projector_px`` is the size that the guess is told, (0, 0) if it is not known; ``chosen`` is one of
    several captures in the folder. Lengths of another program's calibration are in units of ``unit_mm``,
    and ``from_projector`` says that its pose leads from the projector to the camera.
    ``camera_curves`` and ``led_curves`` are tables of that calibration's curves.
    """

    folder: Path | None
    target: Path
    projector_px: Size = (0, 0)
    chosen: str = ""
    calibration: str = NONE
    unit_mm: float = 1.0
    from_projector: bool = False
    camera_curves: Path | None = None
    led_curves: Path | None = None


@dataclass(frozen=True)
class Listing:
    """What each file shows by the mapping, whether all fit, and what the calibration is.

    ``troubles`` are sentences by the part of the dialog that they are about; ``camera_px`` is the size of the
    pictures once they fit.
    """

    table: tuple[tuple[str, str], ...] = ()
    calibration: str = ""
    troubles: tuple[tuple[Place, str], ...] = ()
    camera_px: Size | None = None


@dataclass(frozen=True, eq=False)
class Decoded:
    """Columns of the projector that pixels see, NaN where undecided, and the share of lit pixels with one.

    ``values`` says whether values are linear in light, ``advice`` what to do if not.
    """

    column_px: NDArray[np.float32]
    share: float
    lit: float
    values: str = ""
    advice: str = ""


@dataclass(frozen=True)
class Imported:
    """What was made: a scan, and if it has depth its result; ``verdict`` says how good it is."""

    scan: Path
    result: Path | None
    verdict: str


@dataclass(frozen=True)
class Stated:
    """A mapping, whether it is as it was guessed, and the file that holds it, if one does."""

    mapping: Mapping
    is_guessed: bool = False
    file: Path | None = None


class CapturesState:
    """Values that the controller sets and the dialog follows.

    ``busy`` says what is being done (empty: nothing), ``sets`` are the captures found in the folder.
    ``small`` holds small pictures (rows, columns, 3) of the first files by their names. ``done`` fires with
    what was imported.
    """

    def __init__(self, home: Path) -> None:
        self.request = Value(CaptureRequest(None, home / f"capture{SUFFIX}"))
        self.stated: Value[Stated | None] = Value(None)
        self.sets: Value[tuple[str, ...]] = Value(())
        self.listing = Value(Listing())
        self.small: Value[dict[str, NDArray[np.uint8]]] = Value({})
        self.decoded: Value[Decoded | None] = Value(None)
        self.library: Value[tuple[str, ...]] = Value(())
        self.trouble: Value[tuple[tuple[Place, str], ...]] = Value(())
        self.busy = Value("")
        self.is_importing = Value(False)
        self.done: Event[Imported] = Event()


def target_trouble(request: CaptureRequest) -> str:
    """Why nothing can be saved there, and what to do; empty when it can."""
    target = request.target
    if not target.stem.strip() or target.name.startswith("."):
        return "Enter a name."
    result = target.with_suffix(".zarr")
    for path in (target, result) if request.calibration != NONE else (target,):
        if there(path):
            return f"{path.name} already exists. Choose another name or folder."
    return place_trouble(target)


# View ----------------------------------------------------------------------------------------------

#: Of the lit pixels, so many have a column when the mapping is right, and when it may be.
GOOD_SHARE, FAIR_SHARE = 0.9, 0.5


@dataclass(frozen=True)
class Said:
    """A sentence and its role in the style sheet."""

    text: str = ""
    role: str = "muted"


@dataclass(frozen=True)
class CapturesView:
    """What the dialog says and what can be used; ``go_tip`` says what an import makes."""

    folder: Said
    mapping: Said
    calibration: Said
    target: Said
    columns: Said
    values: Said
    can_set: bool
    can_guess: bool
    can_change: bool
    can_import: bool
    asks_unit: bool
    asks_set: bool
    no_picture: str


def captures_view(state: CapturesState) -> CapturesView:
    """The dialog's texts for what is known now."""
    request, stated, busy = state.request.value, state.stated.value, state.busy.value
    troubles = {**dict(state.listing.value.troubles), **dict(state.trouble.value)}
    if (wrong := target_trouble(request)) and not state.is_importing.value:
        troubles.setdefault(Place.TARGET, wrong)
    if busy and not state.is_importing.value:
        # It is being found out again.
        troubles = {place: text for place, text in troubles.items() if place is Place.TARGET}

    def said(place: Place, else_: Said) -> Said:
        return Said(troubles[place], "bad") if place in troubles else else_

    if troubles.get(Place.MAPPING) == troubles.get(Place.FOLDER):
        # Nothing is gained by reading it twice.
        troubles.pop(Place.MAPPING, None)
    importing, names = state.is_importing.value, [name for name, _ in state.listing.value.table]
    return CapturesView(
        folder=said(
            Place.FOLDER,
            _about_folder(request, stated, busy, names),
        ),
        mapping=said(Place.MAPPING, _about_mapping(stated)),
        calibration=said(Place.CALIBRATION, _about_calibration(state.listing.value.calibration)),
        target=said(Place.TARGET, Said(f"Creates {request.target.name}{_also(request)}.")),
        columns=_about_columns(state.decoded.value),
        values=_about_values(state.decoded.value),
        can_set=not importing,
        can_guess=request.folder is not None and not importing,
        can_change=stated is not None and not importing,
        can_import=stated is not None and not troubles and not busy,
        asks_unit=_is_file(request.calibration),
        asks_set=len(state.sets.value) > 1,
        no_picture=_no_picture(state, troubles),
    )


def _about_folder(request: CaptureRequest, stated: Stated | None, busy: str, names: Sequence[str]) -> Said:
    if busy:
        return Said(f"{busy}…")
    if request.folder is None:
        return Said("Choose the folder with the pictures of one capture. It is only read.")
    origin = ""
    if stated is not None and stated.is_guessed:
        origin = ", mapping guessed from the pictures"
    elif stated is not None and stated.file is not None:
        origin = f", mapping of {stated.file.name}"
    absent = sum(name == NO_FILE for name in names)
    pictures = counted(len(names) - absent, "picture") + (f" and {absent} absent" if absent else "")
    return Said(f"{pictures}{origin}.")


def _about_mapping(stated: Stated | None) -> Said:
    if stated is None or not stated.mapping.unsure:
        return Said("" if stated is None else "Nothing is unsure." if stated.is_guessed else "")
    return Said(
        "Unsure: " + "; ".join(in_window(f"{each}.")[:-1] for each in stated.mapping.unsure) + ".", "warn"
    )


def checks_of(doubts: Iterable[str]) -> list[str]:
    """What speaks against a calibration of another program, a sentence for each."""
    return [f"{DOUBT}{in_window(each)}." for each in doubts]


def _about_calibration(told: str) -> Said:
    return Said(told, "warn" if told.startswith(DOUBT) else "muted")


def _about_columns(decoded: Decoded | None) -> Said:
    if decoded is None:
        return Said()
    if decoded.lit == 0:
        return Said("No pixel is lit: check which pictures are white and black.", "bad")
    known = decoded.column_px[np.isfinite(decoded.column_px)]
    text = f"{100 * decoded.share:.0f} % of the lit pixels have a column"
    if known.size:
        text += f", from {known.min():.0f} to {known.max():.0f}"
    if decoded.share >= GOOD_SHARE:
        return Said(f"{text}.", "good")
    if decoded.share >= FAIR_SHARE:
        return Said(f"{text}. Stripes are too fine or too dark for the others.", "warn")
    return Said(f"{text}. Check the code, the order of its digits and the inverse pictures.", "bad")


def _about_values(decoded: Decoded | None) -> Said:
    """Whether values are linear in light, and what to do if not."""
    if decoded is None:
        return Said()
    advice = sentence(decoded.advice) if decoded.advice else ""
    values = f"Values are {decoded.values}." if decoded.values else ""
    return Said(f"{advice} {values}".strip(), "warn" if advice else "muted")


def _no_picture(state: CapturesState, troubles: dict[Place, str]) -> str:
    """What stands in place of the decoded picture."""
    if state.decoded.value is not None:
        return ""
    if Place.MAPPING in troubles or Place.FOLDER in troubles:
        return "Nothing can be decoded yet."
    return "Decoding…" if state.busy.value else "The decoded columns are shown here."


def _also(request: CaptureRequest) -> str:
    return "" if request.calibration == NONE else f" and its depth, {request.target.stem}.zarr"


def _is_file(calibration: str) -> bool:
    return calibration.lower().endswith(STEREO_SUFFIXES)

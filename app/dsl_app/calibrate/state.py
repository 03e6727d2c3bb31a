"""The window's view of the calibrations of a rig: the campaign, its rows, and the library."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING

from dsl_app.connection.state import RigChoice
from dsl_app.shared.evented import Event, Value
from dsl_app.shared.widget_state import LabelState

if TYPE_CHECKING:
    from dsl_app.calibrate.wizard.state import Seen
    from dsl_core.io.calibration_library import LibraryLine
    from dsl_core.model.figure import Figure


class RowState(Enum):
    """State of a calibration of the campaign; the words are shown."""

    MISSING = "not done yet"
    BEGUN = "begun"
    GOOD = "good"
    AGEING = "ageing"
    OUTSIDE = "outside its limits"
    SUPERSEDED = "superseded"
    OTHER_RIG = "does not fit this rig"
    DAMAGED = "damaged"

    @property
    def is_accepted(self) -> bool:
        """Whether a rig can be assembled with it."""
        return self in (RowState.GOOD, RowState.AGEING, RowState.OUTSIDE)


@dataclass(frozen=True)
class About:
    """What the page says about a calibration before anything of it is loaded.

    ``needs`` says what it takes, and whether the film is on.
    """

    title: str
    purpose: str
    needs: str = ""


#: By name and in order.
ABOUT = {
    "selftest": About(
        "Self-test", "Camera, projector, focus and room", "Needs a white surface. The film is off."
    ),
    "geometry": About(
        "Geometry", "Lenses and pose, from a printed board", "Needs the printed board. The film is off."
    ),
    "spectralon": About(
        "Spectralon", "Light of the LEDs, evenness, white", "Needs the Spectralon. The film is off."
    ),
    "color-checker": About(
        "Color Checker", "Response and emission, from patches", "Needs the Color Checker. The film is off."
    ),
    "bandpass": About(
        "Bandpass filters",
        "Brightness of the film's orders",
        "Needs the Spectralon and the filters. Mount the film now; it stays for all scans.",
    ),
    "depth-stage": About(
        "Depth stage",
        "Position and bend of the film",
        "Needs the stage with a white plane or the Spectralon. The film stays on.",
    ),
}


@dataclass(frozen=True)
class Row:
    """One calibration of the campaign.

    ``reason`` explains the state; ``figure`` is the one that a person judges by; ``has_candidate`` says that
    a fit waits to be judged.
    """

    name: str
    about: About
    state: RowState = RowState.MISSING
    reason: str = ""
    figure: Figure | None = None
    accepted: str = ""
    has_candidate: bool = False


@dataclass(frozen=True)
class CampaignFacts:
    """The campaign that is open; ``rig`` is the one it was begun with."""

    path: Path
    rig: RigChoice


@dataclass(frozen=True)
class DriftVerdict:
    """What a quick shot showed about a calibration of the library.

    ``spectralon`` says that the target was one, ``overridden`` which settings differed and were ignored, and
    ``kept`` that the calibration remembers what was found of the light.
    """

    name: str
    figures: tuple[Figure, ...]
    spectralon: bool = True
    overridden: tuple[str, ...] = ()
    kept: bool = False

    @property
    def passed(self) -> bool:
        """Whether all figures are within their limits."""
        return all(figure.passed for figure in self.figures)

    @property
    def sentence(self) -> str:
        """The verdict in words."""
        verdict = f"The rig {'matches' if self.passed else 'does not match'} the calibration {self.name}."
        return f"{verdict} Scans from now on state the light by this check." if self.kept else verdict


def empty_rows() -> tuple[Row, ...]:
    """The rows while no campaign is open."""
    return tuple(Row(name, about) for name, about in ABOUT.items())


class CalibrateState:
    """Values that the calibrations' controllers set and the page follows.

    ``trouble`` is a sentence on why nothing can be calibrated (empty: nothing is wrong), ``note`` one on what
    was done last in the library, ``outcome`` one on how calibrating everything ended, and
    ``refused`` the calibration at which it was refused (empty: none). ``foreign`` says that
    the campaign belongs to another rig; ``opening`` is the title of the wizard that is being opened;
    ``everything`` says how far a calibration of everything is (empty: none runs), ``running`` names the
    calibration that it is at, ``seen`` is what the camera sees of it. ``in_use`` is the library's name that
    scans use; ``opened`` fires with a file to open in the system's program.
    """

    def __init__(self) -> None:
        self.campaign: Value[CampaignFacts | None] = Value(None)
        self.rows: Value[tuple[Row, ...]] = Value(empty_rows())
        self.foreign = Value(False)
        self.trouble = Value("")
        self.note = Value("")
        self.outcome = Value(LabelState())
        self.refused = Value("")
        self.opening = Value("")
        self.everything = Value("")
        self.running = Value("")
        self.seen: Value[Seen | None] = Value(None)
        self.library: Value[tuple[LibraryLine, ...]] = Value(())
        self.in_use = Value("")
        self.drift: Value[DriftVerdict | None] = Value(None)
        self.opened: Event[Path] = Event()

    @property
    def is_busy(self) -> bool:
        """Whether a wizard is being opened, or everything is calibrated."""
        return bool(self.opening.value or self.everything.value)

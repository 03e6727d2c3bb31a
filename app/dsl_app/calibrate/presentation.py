"""What the Calibrate page shows, computed from its state; its widgets only set it. No Qt."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from datetime import datetime
from html import escape

from dsl_app.calibrate.setting_words import setting_words
from dsl_app.calibrate.state import CalibrateState, Row, RowState
from dsl_app.shared.known_files import breakable
from dsl_app.shared.widget_state import ButtonState, LabelState
from dsl_app.shared.wording import short_name
from dsl_core.devices.base import DeviceRig
from dsl_core.io.calibration_library import LibraryLine
from dsl_core.model.calibration.accepted import AcceptedCalibration, CalibrationNote
from dsl_core.model.conditions import CaptureConditions
from dsl_core.model.figure import Figure
from dsl_core.words import capitalised

#: What to do first, and then: by hand, or on a rig that places targets itself.
CAMPAIGN_HINT = (
    "No campaign is open. First choose New campaign: it makes a folder for all that is measured of this rig."
    " Then {then}. To continue one begun earlier, choose Open campaign."
)
ROW_BY_ROW, BY_ITSELF = "work through rows 1 to 6", "choose Calibrate everything, or work through rows 1 to 6"
NO_VERSION = (
    "<p>The library is empty. It keeps every rig calibrated on this computer, dated and never overwritten:"
    " calibrate everything in a campaign, keep a campaign in the library, or import a file.</p>"
)
#: A hyphen that is the sign of a number, as in ``order -1``.
_SIGN = re.compile(r"(?<!\w)-(?=\d)")
_ROLES = {
    RowState.MISSING: "muted",
    RowState.GOOD: "good",
    RowState.OTHER_RIG: "bad",
    RowState.DAMAGED: "bad",
}


# The campaign ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class CampaignHead:
    """The head of the page: which campaign is open, how far everything is or how that ended, buttons."""

    title: str
    place: str
    progress: LabelState
    new: ButtonState
    open: ButtonState
    keep: ButtonState
    cancel: ButtonState
    everything: ButtonState
    scan: ButtonState


def campaign_head(state: CalibrateState, devices: DeviceRig | None) -> CampaignHead:
    """The head of the page while these devices are connected (None: no rig is)."""
    facts, progress = state.campaign.value, state.everything.value
    is_running = bool(progress)
    usable = facts is not None and devices is not None and not state.foreign.value and not is_running
    has_accepted = any(row.state.is_accepted for row in state.rows.value)
    places_itself = _places_itself(devices)
    main = main_button(state, devices)
    title = "Calibrate"
    place = CAMPAIGN_HINT.format(then=BY_ITSELF if places_itself else ROW_BY_ROW)
    if facts is not None:
        title, place = (
            short_name(facts.path.name),
            f"in {breakable(facts.path.parent)}  ·  rig {facts.rig.words}",
        )
    return CampaignHead(
        title,
        place,
        LabelState(progress, "warn" if progress == "stopping" else "muted")
        if progress
        else state.outcome.value,
        new=ButtonState(is_enabled=not is_running, is_primary=main == "new"),
        open=ButtonState(is_enabled=not is_running),
        keep=ButtonState(facts is not None and not is_running, usable and has_accepted, main == "keep"),
        cancel=ButtonState(is_running),
        everything=ButtonState(
            not is_running, usable and places_itself, main == "everything", why=_why_not(state, devices)
        ),
        scan=ButtonState(main == "scan", is_primary=True),
    )


def _why_not(state: CalibrateState, devices: DeviceRig | None) -> str:
    """Why not everything can be calibrated at once."""
    if state.campaign.value is None:
        return "Begin or open a campaign first."
    if devices is None or state.foreign.value:
        return "Connect the campaign's rig first."
    return "This rig does not place targets itself: work through rows 1 to 6."


def main_button(state: CalibrateState, devices: DeviceRig | None) -> str:
    """What a person does next: new, keep, use, scan, everything, or a calibration's name; empty for nothing.

    A rig that does not place targets itself is calibrated row by row, and so is a calibration that was
    refused, or whose fit waits to be judged: its wizard shows what is wrong, and starting everything again
    would end there again. One that is kept is used for scans, and then a scan is planned.
    Without a rig, or with another one, the message across the page has the button that connects it.
    """
    if state.campaign.value is None:
        return "new"
    if state.everything.value or state.foreign.value:
        return ""
    left = [row.name for row in state.rows.value if not row.state.is_accepted]
    if not left:
        kept = kept_version(state)
        return "keep" if kept is None else ("scan" if _is_used(kept, state.in_use.value) else "use")
    if devices is None:
        return ""
    first = left[0]
    needs_judging = first == state.refused.value or any(
        row.has_candidate for row in state.rows.value if row.name == first
    )
    return "everything" if _places_itself(devices) and not needs_judging else first


def kept_version(state: CalibrateState) -> LibraryLine | None:
    """The version in the library of exactly what the campaign accepted; None before it is kept."""
    accepted = {row.name: row.accepted for row in state.rows.value if row.state.is_accepted}
    for line in state.library.value:
        if line.entry is not None and accepted:
            notes = {note.name: note.accepted for note in line.entry.rig.calibrations}
            if notes == accepted:
                return line
    return None


def _places_itself(devices: DeviceRig | None) -> bool:
    return devices is not None and devices.place is not None


# One calibration -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class RowDisplay:
    """A calibration of the campaign in words; roles are those of the style sheet."""

    state: LabelState
    figure: LabelState
    date: str
    reason: LabelState
    run: ButtonState


def row_display(
    row: Row, is_busy: bool = False, running: str = "", is_next: bool = False, opening: str = ""
) -> RowDisplay:
    """A row of the page, which may be what a person does next.

    While ``is_busy`` no wizard can be opened; ``running`` says what is done for it. ``opening`` is the title
    of the wizard that is being opened, which takes a second or two.
    """
    title, figure = row.about.title, row.figure
    role = "" if figure is None or figure.passed else "bad"
    begun = row.state is RowState.BEGUN or row.has_candidate
    word = "Continue…" if begun else ("Open…" if row.accepted else "Run…")
    if opening == title:
        word = "Opening…"
    tip = f"Open the wizard of {title}, which continues where it was left"
    if running:
        # What was known of it before is about to be replaced.
        row = replace(row, reason=running, accepted="")
        figure = None
    elif row.state is RowState.MISSING and not row.reason:
        row = replace(row, reason=row.about.needs)
    return RowDisplay(
        state=LabelState("▶ running", "heading")
        if running
        else LabelState(f"● {row.state.value}", _ROLES.get(row.state, "warn")),
        figure=LabelState() if figure is None else LabelState(figure_words(figure), role),
        date=short_date(row.accepted),
        reason=LabelState(row.reason, "muted", row.reason),
        run=ButtonState(True, not is_busy, is_next, word, tip, f"{word.rstrip('…')} {title}"),
    )


def figure_words(figure: Figure) -> str:
    """A figure against its limits in one line, such as ``camera error 0.051 px (at most 0.5 px)``.

    Lines break between the three, never between a number and its unit.
    """
    limits = figure.limits.replace("-", "−")
    value, limits = (text.replace(" ", "\N{NO-BREAK SPACE}") for text in (value_words(figure), limits))
    return f"{name_words(figure)} {value}" + (f"  ({limits})" if limits else "")


def name_words(figure: Figure) -> str:
    """The name of a figure with typographic signs; hyphens between words stay.

    >>> name_words(Figure(name="held-out efficiency of order -1", value=1.0, unit="%"))
    'held-out efficiency of order −1'
    """
    return _SIGN.sub("−", figure.name)


def value_words(figure: Figure) -> str:
    """Value ± standard deviation and unit, with a typographic minus.

    >>> value_words(Figure(name="shift", value=-1.25, std=0.04, unit="nm"))
    '−1.250 ± 0.040 nm'
    >>> value_words(Figure(name="corners", value=77.0, unit=""))
    '77'
    """
    if figure.std is None and figure.unit == "" and figure.value == round(figure.value):
        return f"{figure.value:.0f}".replace("-", "−")
    return str(figure).removeprefix(figure.name).strip().replace("-", "−")


def short_date(time: str) -> str:
    """A time of ISO 8601 to the minute, in local time; empty stays empty."""
    return _local(datetime.fromisoformat(time)) if time else ""


def _local(time: datetime) -> str:
    return time.astimezone().strftime("%Y-%m-%d %H:%M")


# The library -----------------------------------------------------------------------------------------


def version_texts(line: LibraryLine, in_use: str) -> tuple[str, ...]:
    """The cells of a version: name, date, use, camera, projector, figures outside limits.

    ``in_use`` is the key of the calibration that scans use.
    """
    use = "scans" if _is_used(line, in_use) else ("current" if line.is_current else "")
    stored = stamp_date(line.stamp)
    if line.entry is None:
        return line.name, stored, use, "damaged", "", ""
    rig = line.entry.rig
    missed = [str(figure) for note in rig.calibrations for figure in note.failed]
    return (
        line.name,
        stored,
        use,
        f"{rig.provenance.camera_serial or '–'}, {rig.camera.width_px} × {rig.camera.height_px} px",
        rig.provenance.projector_serial or "–",
        ", ".join(missed) or "none",
    )


def _is_used(line: LibraryLine, in_use: str) -> bool:
    return (line.is_current and in_use == line.name) or in_use == f"{line.name}@{line.stamp}"


def stamp_date(stamp: str) -> str:
    """When a version was saved, in local time; a stamp that is not a time stays."""
    try:
        return _local(datetime.strptime(f"{stamp}+0000", "%Y%m%d-%H%M%S-%f%z"))
    except ValueError:
        return stamp


@dataclass(frozen=True)
class LibrarySelection:
    """The selected version: its key (a name, or NAME@STAMP), details as HTML, and what can be done."""

    key: str = ""
    details: str = NO_VERSION
    can_use: bool = False
    can_restore: bool = False


def library_selection(line: LibraryLine | None) -> LibrarySelection:
    """What is shown of a version; None for no selection."""
    if line is None:
        return LibrarySelection()
    key = line.name if line.is_current else f"{line.name}@{line.stamp}"
    is_readable = line.entry is not None
    return LibrarySelection(key, _details(line), is_readable, is_readable and not line.is_current)


def _details(line: LibraryLine) -> str:
    if line.entry is None:
        return f"<p><b>{escape(line.name)}</b></p><p>{escape(line.error)}</p>"
    rig = line.entry.rig
    settings = {each.name: each for each in line.entry.accepted}
    parts = [f"<p><b>{escape(line.name)}</b><br>{escape(rig.provenance.notes)}</p>"]
    parts.append(_conditions(rig.conditions))
    parts += [_calibration(note, settings.get(note.name)) for note in rig.calibrations]
    return "".join(parts)


def _conditions(known: CaptureConditions | None) -> str:
    if known is None:
        return "<p>The settings of its captures were not recorded.</p>"
    camera, projector = known.camera, known.projector
    region = "whole sensor" if camera.region_px is None else "region {} {} {} {} px".format(*camera.region_px)
    rows = (
        ("Camera", f"{camera.model}, {camera.serial}"),
        (
            "Readout",
            f"{camera.size_px[0]} × {camera.size_px[1]} px, {region}, binning {camera.binning},"
            f" {camera.gain_db:g} dB, {camera.bit_depth} bits",
        ),
        ("Projector", f"{projector.model}, {projector.serial}"),
        (
            "Projected",
            f"{projector.size_px[0]} × {projector.size_px[1]} px, {projector.frame_period_ms:.3f} ms"
            + (f", {projector.mode}" if projector.mode else ""),
        ),
    )
    cells = "".join(f"<tr><td>{name}&nbsp;&nbsp;</td><td>{escape(text)}</td></tr>" for name, text in rows)
    return f"<table>{cells}</table>"


def _calibration(note: CalibrationNote, accepted: AcceptedCalibration | None) -> str:
    rows = "".join(map(_figure_row, note.figures))
    lines = [f"<table>{rows}</table>"] if rows else []
    if accepted is not None:
        own = (setting_words(key, value) for key, value in accepted.settings.items() if key != "rig")
        text = escape("; ".join(own))
        lines += [f"<p><i>{text}</i></p>"] if text else []
    head = f"<b>{escape(note.title)}</b>, {escape(short_date(note.accepted))}"
    return f"<p>{head}</p>{''.join(lines)}"


def _figure_row(figure: Figure) -> str:
    """A figure as a row of a table: whether it passes, name, value, limits."""
    mark = ("✓" if figure.passed else "✗") * bool(figure.limits)
    cells = (mark, capitalised(name_words(figure)), value_words(figure), figure.limits.replace("-", "−"))
    return "<tr>" + "".join(f"<td>{escape(text)}&nbsp;&nbsp;</td>" for text in cells) + "</tr>"

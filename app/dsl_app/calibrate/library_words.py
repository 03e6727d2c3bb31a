"""What a version of the library holds, as text: conditions, dates, figures with uncertainties."""

from __future__ import annotations

from html import escape

from dsl_app.calibrate.row import figure_words, short_date
from dsl_core.io.calibration_library import LibraryLine
from dsl_core.model.calibration.accepted import AcceptedCalibration, CalibrationNote
from dsl_core.model.conditions import CaptureConditions

NOTHING = (
    "<p>The library is empty. It keeps every calibrated rig of this computer, dated and never overwritten:"
    " calibrate everything of a campaign, keep one in the library, or import a file.</p>"
)


def details_of(line: LibraryLine) -> str:
    """A version as HTML."""
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
        return "<p>Nobody noted under which settings it was captured.</p>"
    camera, projector = known.camera, known.projector
    region = "whole sensor" if camera.region_px is None else "region {} {} {} {} px".format(*camera.region_px)
    rows = (
        ("Camera", f"{camera.model}, {camera.serial}"),
        (
            "Read out",
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
    lines = [
        ("✓ " if figure.passed else "✗ ") * bool(figure.limits) + escape(figure_words(figure))
        for figure in note.figures
    ]
    if accepted is not None:
        own = (f"{key} {value}" for key, value in accepted.settings.items() if key != "rig")
        text = escape("; ".join(own))
        lines += [f"<i>{text}</i>"] if text else []
    head = f"<b>{escape(note.title)}</b>, {short_date(note.accepted)}"
    return f"<p>{head}<br>{'<br>'.join(lines)}</p>"

"""What the head of the Results page says of the result that is open, and what can be done with it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path

from dsl_core.io.result.completed import missing_text
from dsl_core.io.result.result_arrays import ResultArrays
from dsl_core.model.attributes import DOUBTS, sentences_of
from dsl_core.model.calibration.accepted import read_missed
from dsl_core.model.fit import Fit
from dsl_core.model.rendered_effects import RenderedEffects
from dsl_core.solve.normal import BAND_95
from dsl_core.words import counted


class Content(IntEnum):
    """What the page shows, by its place in the stack."""

    OFFER = 0
    RESULT = 1
    WELCOME = 2


@dataclass(frozen=True)
class Summary:
    """What the page shows: texts of its head, and which buttons can be used.

    ``message`` stands in place of a result; ``can_reconstruct`` means that a scan is offered. ``warning``
    says which pictures are in doubt, which limits the rig's calibrations missed and what of the model does
    not fit, ``advice`` what to do; both are empty where all is well.
    """

    content: Content
    title: str = "Results"
    about: str = ""
    details: str = ""
    message: str = ""
    can_reconstruct: bool = False
    has_result: bool = False
    warning: str = ""
    advice: str = ""


def summarise(result: ResultArrays | None, offer: Path | None, busy: str, is_begun: bool = False) -> Summary:
    """The summary of a result, of an offered scan, or of what is being opened.

    Of a result that has only begun, the depth is shown; there is nothing to be done with it yet.
    """
    content = Content.WELCOME if result is None else Content.RESULT
    message = ""
    if busy and not is_begun:
        content, message = Content.OFFER, f"{busy}…"
    elif offer is not None and not is_begun:
        content, message = Content.OFFER, f"{offer.name} has no result yet. Reconstruct it now?"
    can_reconstruct = offer is not None and not busy
    if offer is not None and not is_begun:
        # What was open before is not shown, and nothing can be done with it here.
        head = offer.stem, str(offer), str(offer)
        return Summary(content, *head, message=message, can_reconstruct=can_reconstruct)
    if result is None:
        return Summary(content, message=message)
    height, width = result.shape
    bands = f" · {counted(len(result.wavelengths_nm), 'band')}" if result.has_spectra else " · depth only"
    if is_begun:
        text = f"{width} × {height} px · depth; the spectra are being computed"
        return Summary(content, title=result.path.stem, about=text, details=str(result.path))
    captured = str(result.attributes.get("captured", ""))[:16].replace("T", " ")
    effects, details = effects_text(result.attributes)
    fit = Fit.read(result.attributes)
    missed = read_missed(result.attributes)
    in_doubt = sentences_of(result.attributes, DOUBTS)
    doubted = fit if fit is not None and fit.significant else None
    lacks = [text] if (text := missing_text(result)) else []
    unseen = [fit.unseen] if fit is not None and fit.unseen else []
    parts = (f"{width} × {height} px{bands}", scale_text(fit), captured, effects, str(result.path))
    texts = (str(result.path), "\n".join((*in_doubt, *missed)), fit.words if fit else "", details)
    return Summary(
        content,
        title=result.path.stem,
        about=" · ".join(part for part in parts if part),
        details="\n\n".join(part for part in texts if part),
        message=message,
        has_result=True,
        warning=" ".join([*in_doubt[:1], *missed, *([doubted.headline] if doubted else []), *lacks, *unseen]),
        advice="\n".join([*in_doubt, *missed, *([doubted.words] if doubted else unseen), *lacks]),
    )


def scale_text(fit: Fit | None) -> str:
    """To what share the scale of reflectance is known at 95 %; empty where nobody says.

    >>> scale_text(Fit(scale_rel_std=0.025))
    'scale of reflectance known to 4.9 %'
    """
    if fit is None or fit.scale_rel_std is None:
        return ""
    return f"scale of reflectance known to {100 * BAND_95 * fit.scale_rel_std:.1f} %"


def effects_text(attributes: Mapping[str, object]) -> tuple[str, str]:
    """A short and a long text on the rendered effects of a simulated scan; empty where none are noted."""
    found = RenderedEffects.of_note(str(attributes.get("effects", "")))
    if found is None:
        return "", ""
    on = [effect.name for effect in found.effects if effect.on]
    off = [effect.name for effect in found.effects if not effect.on]
    within = f" within {found.tolerance}" if found.choice == "auto" else ""
    # A list of names does not fit into the line.
    choice = "chosen" if "," in found.choice else found.choice
    short = f"effects {choice}{within}: {len(on)} of {len(found.effects)}"
    long = (
        f"The simulated rig rendered {', '.join(on)}.\nIt left out {', '.join(off) or 'nothing'}.\n"
        f"A frame took about {1e3 * found.frame_s:.0f} ms to compute instead of"
        f" {1e3 * found.frame_with_all_s:.0f} ms with all effects: {100 * found.saved_share:.0f} % less."
    )
    return short, long

"""The effects that a simulated scan rendered, in words."""

from __future__ import annotations

from collections.abc import Mapping

from dsl_core.evaluation.rendered_effects import RenderedEffects


def rendered_words(attributes: Mapping[str, object]) -> tuple[str, str]:
    """A short and a long text on the effects of a result; both empty where it does not say any."""
    found = RenderedEffects.of_note(str(attributes.get("effects", "")))
    if found is None:
        return "", ""
    on = [effect.name for effect in found.effects if effect.on]
    off = [effect.name for effect in found.effects if not effect.on]
    within = f" within {found.tolerance}" if found.choice == "auto" else ""
    short = f"effects {_short(found.choice)}{within}: {len(on)} of {len(found.effects)}"
    long = (
        f"The simulated rig rendered {', '.join(on)}.\nIt left out {', '.join(off) or 'nothing'}.\n"
        f"A frame took about {1e3 * found.frame_s:.0f} ms to compute,"
        f" {1e3 * found.frame_with_all_s:.0f} ms with everything:"
        f" {100 * found.saved_share:.0f} % were saved."
    )
    return short, long


def _short(choice: str) -> str:
    """Many names are as good as none in a line."""
    return "chosen" if "," in choice else choice

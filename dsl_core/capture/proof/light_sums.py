"""What sums of light say of projector and camera, as a sentence that names the likeliest cause first."""

from __future__ import annotations

from dsl_core.capture.proof.code.code_sum import CodeSum
from dsl_core.capture.proof.lines.line_sum import LESS_THAN_NONE, LineSum, is_below_none

#: No deviation is given as less than this.
LEAST_STD = 0.005
_STEADY = (
    "Switch dynamic contrast, dynamic black, iris, eco mode and limits of power of the projector off, and"
    " automatic modes of the camera"
)
_RAW = (
    "Switch gamma, tone mapping, high dynamic range and sharpening of the camera and of the projector off,"
    " store raw values, repeat the self-test"
)
_KEEP = "keep the light of the room as it is, and scan again."


def light_sentence(code: CodeSum | None, lines: LineSum | None) -> str:
    """What is wrong with light that should add up to white; empty if nothing is.

    None are sums that say nothing. A projector that dims dark or bright pictures gives the code, half bright,
    another share than white. One that dims its lamp for black alone makes every picture a little too bright:
    much for many faint lines together, little for a pair of the code. A camera whose values are not
    proportional to the light leaves the code as it is, but for edges of stripes; lines have most of their
    light in such faint parts.
    """
    of_lines = "" if lines is None else f"{lines.share:.2f} ± {max(lines.std, LEAST_STD):.2f}"
    if code is not None and code.is_curved:
        more = f" All lines together have {of_lines} times the light of white." if of_lines else ""
        return (
            "Where a pattern and its inverse both light a pixel, they have together"
            f" {code.share + code.curve:.2f} ± {max(code.curve_std, LEAST_STD):.2f} times the light of white,"
            f" and elsewhere {code.share:.2f} times.{more} The camera's values are not proportional to the"
            f" light, or the projector sharpens its picture. {_RAW}, and scan again."
        )
    if code is not None and code.is_uneven:
        both = f" and all lines {of_lines} times," if of_lines else ""
        return (
            "Patterns and their inverses together have"
            f" {code.share:.2f} ± {max(code.std, LEAST_STD):.2f} times the light of white,{both} which they"
            " add up to. The light of the projector depends on how bright its picture is, or it changed just"
            f" before white. {_STEADY}, and scan again."
        )
    if lines is None or not lines.is_off:
        return ""
    seen = f"All lines together have {of_lines} times the light of white, which they add up to"
    if is_below_none(lines.share, lines.std):
        return f"{seen}{LESS_THAN_NONE}"
    if code is not None and lines.share > 1:
        return (
            f"{seen}; patterns and their inverses do add up to it. The projector makes a picture that is all"
            " black darker than the dark parts of others (dynamic black, iris), other light came in while"
            " lines were captured, or the camera's values are not proportional to the light, or its exposure"
            f" changed. {_STEADY}. {_RAW}, {_KEEP}"
        )
    return (
        f"{seen}. The projector gives dark pictures another share of its light than bright ones, the exposure"
        f" changed in between, or other light came in. {_STEADY}; {_KEEP}"
    )

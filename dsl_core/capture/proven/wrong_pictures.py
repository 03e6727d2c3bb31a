"""The error of pictures that stay wrong, and what to do about them."""

from __future__ import annotations

from collections.abc import Collection

from dsl_core.capture.diagnosis import Explanation
from dsl_core.capture.proof.finding import Finding, Verdict
from dsl_core.capture.proof.verifier import FrameProof
from dsl_core.errors import DeviceError
from dsl_core.model.plan import Shot, describe_shot

#: Lines that are wrong like this while white, black and code look as at first have lost light of their own.
DIM = (Verdict.DARK, Verdict.EXPOSURE)
#: Pictures that are wrong like this, though nothing has changed that anybody could name, may have become so
#: slowly: nobody knows since when.
CREEPING = (Verdict.EXPOSURE, Verdict.OTHER, Verdict.DISPLACED)
#: Somebody in the way, or a lamp, is seen at once.
PASSING = (Verdict.HIDDEN, Verdict.PASSING)
_DIMMED = (
    "White, black and a frame of the code, captured once more, look as they did: the projector may give dark"
    " pictures less light than bright ones. Switch its dynamic contrast, iris and eco mode off, and check"
    " that the exposure is long enough."
)
#: The same of the first pictures at a drive level of their own.
_TONE = (
    "White, black and a frame of the code, captured once more, look as they did: the projector gives another"
    " share of its light at this drive level than its calibration says, the camera's values are not"
    " proportional to the light, or it exposes for longer or shorter than requested. Repeat the self-test,"
    " which measures how light follows the level, or use one level in all settings; or switch gamma,"
    " automatic exposure and gain of the camera off."
)
#: The same of stripes of the code of which coarser ones show nothing wrong.
_FINE = (
    "Coarser stripes of the code are right and these are not: the projector's picture is scaled (a resolution"
    " that is not its own, overscan, keystone) or sharpened, or something is out of focus or trembles. Send"
    " the projector pictures of its own size, switch such corrections off, and check the focus."
)
#: The same of pairs of the code that add up to something else than others, whenever they are captured.
_NOT_ADDED_UP = (
    "It looks the same each time, and nothing shows that anything moved: the camera's values may not be"
    " proportional to the light of each pixel alone, or the projector smooths or sharpens edges of its"
    " picture. Switch gamma, compression, sharpening and noise reduction of the camera off, and store raw"
    " values; switch sharpness, noise reduction and scaling of the projector off. If that is not why:"
)


class PictureError(DeviceError):
    """Pictures do not show their pattern, however often they are taken; ``wrong`` are their shots.

    ``has_changed``: devices, light or scene are not as they were, and nobody knows since when.
    """

    def __init__(self, message: str, wrong: tuple[Shot, ...] = (), *, has_changed: bool = False) -> None:
        """Keep the sentence and the shots."""
        super().__init__(message)
        self.wrong, self.has_changed = wrong, has_changed


def what_to_do(found: Finding, change: Explanation, proof: FrameProof, is_steady: bool) -> str:
    """Why a picture stays wrong as far as that is known, and what to do about it.

    A pair of the code ``is_steady`` that looks the same whenever it is captured again.
    """
    if found.verdict in PASSING and not change.is_of_all:
        # Who stands there is in the pictures that would say what has changed, too.
        return found.remedy
    if change.is_as_at_first:
        if found.verdict in DIM and found.shot.role == "spectral":
            return _DIMMED
        if found.verdict is Verdict.EXPOSURE and not proof.is_at_first_level(found.shot):
            return _TONE
    if not change.sentence and proof.are_finest(found.again):
        return _FINE
    if not change.sentence and is_steady and found.verdict is Verdict.OTHER:
        return f"{_NOT_ADDED_UP} {found.remedy}"
    if change.is_slight:
        return f"{change.sentence} If that is not why: {found.remedy}"
    return change.sentence or found.remedy


def has_begun_before(found: Finding, change: Explanation) -> bool:
    """Whether pictures before one that stays wrong may be spoiled as well, and nobody knows since when.

    What has changed in white, black and code since the scan began is in some of them.
    """
    if change.has_moved:
        return True
    return found.verdict not in PASSING if change.sentence else found.verdict in CREEPING


def why_control_differs(is_mirrored: bool) -> str:
    """What to say of a picture of the code that is not as it was, where white and black are.

    Most frames of a Gray code, mirrored, look as before; those with the widest stripes do not.
    """
    if is_mirrored:
        return (
            "It is mirrored: the projector's picture is turned or mirrored, and was not when the scan began."
            " Set projector and computer as they were."
        )
    return (
        "Projector, camera, light or target have changed since. Check that the projector follows, that no"
        " automatic mode is on, and that nothing has moved."
    )


def displaced(first: Shot, reason: str, again: Collection[Shot]) -> PictureError:
    """That a picture of the code, captured once more, is elsewhere, so that others are taken ``again``."""
    return PictureError(
        f"{describe_shot(first).capitalize()}, captured once more, is displaced from where it was: projector,"
        " camera or target moved while the code was captured, or the projector corrects or scales its"
        f" picture. {reason} Frame {first.number} is kept.",
        tuple(again),
        has_changed=True,
    )


def said_of_corrected(count: int, is_late: bool) -> list[str]:
    """Sentences on so many shots that were taken again, in a scan that took every picture twice or not."""
    if not count:
        return []
    what = "1 was" if count == 1 else f"{count} were"
    found = [f"{what} captured again, because a picture did not show its pattern."]
    return [*found, "Everything was captured twice, since pictures came one late."] if is_late else found

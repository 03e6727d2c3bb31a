"""What a picture was found to show, and the sentences that say so."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

from dsl_core.model.plan import Shot, describe_shot
from dsl_core.words import counted


class Verdict(StrEnum):
    """What a picture shows; all but the first two need the shot to be taken again."""

    RIGHT = "right"
    UNTOLD = "cannot tell"
    LATE = "late"
    REPEATED = "repeated"
    SWAPPED = "swapped"
    TORN = "torn"
    EXPOSURE = "wrong exposure"
    SATURATED = "saturated"
    DARK = "dark"
    MIRRORED = "mirrored"
    DISPLACED = "displaced"
    HIDDEN = "partly hidden"
    COLOURS = "other colours"
    PASSING = "passing light"
    ROWS_TWICE = "rows twice"
    OTHER = "another picture"


class Light(StrEnum):
    """What a picture says of the light that its pattern gives."""

    UNTOLD = "cannot tell"
    USUAL = "as in the pictures before"
    STEP = "unlike the pictures before"


_SEEN = {
    Verdict.LATE: "it still shows the pattern before",
    Verdict.REPEATED: "it is the picture before, pixel by pixel",
    Verdict.SWAPPED: "it shows the pattern of another shot",
    Verdict.TORN: "only a part of it shows that pattern, the rest another one",
    Verdict.EXPOSURE: "its brightness is wrong",
    Verdict.SATURATED: "most of it is saturated",
    Verdict.DARK: "the pattern is missing from it",
    Verdict.MIRRORED: "columns of the projector run across the picture the wrong way round",
    Verdict.DISPLACED: "it is displaced from the pictures before",
    Verdict.HIDDEN: "a part of it is darker than the black picture, as if something were before it",
    Verdict.COLOURS: "some of its colours are darker than in the black picture, and others are not",
    Verdict.PASSING: "a part of it has other light than in the lines before and after",
    Verdict.ROWS_TWICE: "some of its rows come twice",
    Verdict.OTHER: "it shows something else",
}
_KEEP_OUT = "Keep out of the way of camera, projector and lamps, and keep the light of the room as it was."
_REMEDY = {
    Verdict.LATE: "Let the projector settle for longer (its latency), and check that it follows.",
    Verdict.REPEATED: "Restart the camera.",
    Verdict.SWAPPED: "Check how camera and projector are synchronised.",
    Verdict.TORN: "Let the projector settle for longer (its latency), or expose for whole frames of it; keep"
    " messages and windows out of its picture, and people out of its way.",
    Verdict.EXPOSURE: "Switch automatic exposure and gain of the camera off, and check the lamp.",
    Verdict.SATURATED: "Check exposure and gain of the camera, and the light of the room.",
    Verdict.DARK: "Check that the projector is on, that nothing stands in its way, and that the exposure is"
    " long enough.",
    Verdict.MIRRORED: "Camera or projector is mirrored or upside down, or the calibration is of another rig:"
    " switch mirroring off in the settings of both, or calibrate again.",
    Verdict.DISPLACED: "Check that projector, camera and target have not moved since the scan began,"
    " and that the projector does not correct or scale its picture.",
    Verdict.HIDDEN: _KEEP_OUT,
    Verdict.PASSING: _KEEP_OUT,
    Verdict.COLOURS: "Switch automatic white balance of the camera off, and look whether the light of the"
    " room has changed its colour.",
    Verdict.ROWS_TWICE: "Packets of the camera's link are lost or sent again: check its cable, its network"
    " and the size of packets.",
    Verdict.OTHER: "Check that camera, target and light have not moved since the scan began, and that the"
    " lamp has warmed up and keeps its light.",
}


@dataclass(frozen=True)
class Finding:
    """What the picture of ``shot`` was found to show.

    ``again`` are the shots to take again, in the order of the plan: more than one where only together they
    are known to be wrong. ``detail`` says what was seen in more words, such as which other shot. A picture
    ``is_doubtful`` if it cannot be told and is unlike its neighbours, if a few rows of it do not show its
    pattern or its line seems to be beside its place, which ``detail`` then says, or if its ``light`` has
    changed; a second picture says if it was right. ``colour`` is one that seems to be of another pattern.
    """

    shot: Shot
    verdict: Verdict
    again: tuple[Shot, ...] = ()
    detail: str = ""
    is_doubtful: bool = False
    light: Light = Light.UNTOLD
    colour: str = ""

    @property
    def is_wrong(self) -> bool:
        """Whether shots have to be taken again."""
        return bool(self.again)

    @property
    def is_sure(self) -> bool:
        """Whether a picture shows its pattern in its usual light: all is well then, and was before it."""
        return self.verdict is Verdict.RIGHT and self.light is Light.USUAL

    @property
    def names(self) -> str:
        """The shots that are wrong, or of which at least one is."""
        if len(self.again) == 1:
            return describe_shot(self.again[0])
        first, last = self.again[0], self.again[-1]
        between = "or" if len(self.again) == 2 else "to"
        return f"{describe_shot(first)} {between} {describe_shot(last)}"

    @property
    def seen(self) -> str:
        """What was seen instead of the pattern, as a clause."""
        what = _SEEN.get(self.verdict, "")
        return f"{what} ({self.detail})" if self.detail else what

    @property
    def sentence(self) -> str:
        """Which shots do not show their pattern, and what was seen instead."""
        return f"{self.names.capitalize()} does not show its pattern: {self.seen}."

    @property
    def remedy(self) -> str:
        """What a person can do."""
        return _REMEDY.get(self.verdict, "")


def last_wrong(findings: Sequence[Finding]) -> Finding:
    """What pictures taken one after the other show: the last wrong one, with all shots that are wrong."""
    wrong = [found for found in findings if found.is_wrong]
    if not wrong:
        return findings[-1]
    again = sorted({shot for found in wrong for shot in found.again}, key=lambda shot: shot.index)
    return replace(wrong[-1], again=tuple(again))


def of_another_pattern(colour: str) -> str:
    """What to say of a colour that seems to be of another pattern, as a `Finding.detail`."""
    return f"its {colour} was that of another pattern"


def displaced(shot: Shot, again: tuple[Shot, ...], columns: int) -> Finding:
    """That shots are shown so many columns or more away from their place, positive towards higher ones."""
    where = "higher" if columns > 0 else "lower"
    detail = f"at least {counted(abs(columns), 'column')} towards {where} columns"
    return Finding(shot, Verdict.DISPLACED, again, detail)


def together(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Findings with those that follow each other and say the same of displaced shots made one."""
    found: list[Finding] = []
    for each in findings:
        before = found[-1] if found else None
        same = before is not None and (before.verdict, before.detail) == (Verdict.DISPLACED, each.detail)
        if before is not None and same and before.again[-1].setting == each.again[0].setting:
            found[-1] = replace(before, again=(*before.again, *each.again))
        else:
            found.append(each)
    return tuple(found)


@dataclass(frozen=True)
class ProofReport:
    """What a check of ``judged`` frames found: what is ``wrong``, and how many cannot be told.

    ``light`` are sentences on what lines and pairs of the code add up to, where that is not white.
    """

    judged: int
    wrong: tuple[Finding, ...]
    untold: int
    light: tuple[str, ...] = ()

    @property
    def sentences(self) -> tuple[str, ...]:
        """A sentence for everything that is wrong."""
        return (*(each.sentence for each in self.wrong), *self.light)

"""What a picture is found to be, from its contests with its rivals and from its light."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from dsl_core.capture.proof.contest import Contest
from dsl_core.capture.proof.finding import Finding, Light, Verdict, displaced
from dsl_core.capture.proof.judging.known import Learned
from dsl_core.capture.proof.lines.line_place import is_aside
from dsl_core.capture.proof.usual_light import LEAST_LIGHT
from dsl_core.model.plan import Shot, describe_shot

#: Where several rivals won, the picture before is blamed if its votes are nearly as many (their mean), and
#: another place of the same line only if its are more.
NEARLY = 0.3
#: Where a line lights so few pixels, most may see an edge, and vote for nothing; or those of a coarse picture
#: see some columns each, and so its line and the next. Another picture then tells whether it was late.
FEW_VOTES = 60


def decide(
    shot: Shot,
    contests: Mapping[Verdict, Contest],
    share: float | None,
    learned: Learned,
    name: Callable[[], Shot | None] = lambda: None,
) -> Finding:
    """A finding on a picture, which ``learned`` takes into account from now on.

    ``share`` is the light of what is lit over its prediction, None where that is not known, and ``name``
    says which line a picture shows that is not the one wanted.
    """
    told = {verdict: contest for verdict, contest in contests.items() if contest.is_told}
    lost = {verdict: contest for verdict, contest in told.items() if contest.is_lost}
    ratio = None if share is None else share / learned.usual.share(shot)
    if set(lost) == {Verdict.DARK} and ratio is not None and ratio > LEAST_LIGHT:
        return Finding(shot, Verdict.EXPOSURE, (shot,), f"{ratio:.2g} times what was expected")
    if lost:
        shown = name()
        is_even = all(each.count < FEW_VOTES and each.mean > -NEARLY for each in lost.values())
        if is_even and shown is not None and abs(shown.index - shot.index) <= 1:
            return Finding(shot, Verdict.UNTOLD, is_doubtful=True)
        return named(shot, lost, shown)
    if any(contest.is_torn for contest in told.values()):
        return Finding(shot, Verdict.TORN, (shot,))
    found = learned.usual.judge(shot, share)
    if found.is_wrong:
        return found
    light = learned.steps.judge(shot, share, contests.get(Verdict.DARK))
    # That a picture is neither white nor black does not say that it is the one wanted.
    is_told = Verdict.LATE in told
    is_frayed = is_told and any(contest.is_doubtful for contest in told.values())
    detail = "a few rows of it showed another pattern" if is_frayed else ""
    detail = _unclear(shot, told, learned) or detail
    return Finding(
        shot,
        Verdict.RIGHT if is_told else Verdict.UNTOLD,
        detail=detail,
        is_doubtful=bool(detail) or light is Light.STEP,
        light=light,
    )


def _unclear(shot: Shot, told: Mapping[Verdict, Contest], learned: Learned) -> str:
    """That a line is mixed with the one before or after it; empty if it is not."""
    if shot.role != "spectral":
        return ""
    near = [each for each in (Verdict.LATE, Verdict.SWAPPED) if each in told]
    # Each of them is asked, as each remembers.
    unclear = [learned.votes.is_unclear(shot, each, told[each]) for each in near]
    return "it was mixed with another pattern" if any(unclear) else ""


def named(shot: Shot, lost: Mapping[Verdict, Contest], shown: Shot | None) -> Finding:
    """What a picture shows that is not the one wanted, from the rivals that won and the line it shows."""
    if shown is not None and shown != shot:
        near = {-1: Verdict.LATE, 1: Verdict.SWAPPED}
        verdict = near.get(shown.index - shot.index, Verdict.OTHER)
        return Finding(shot, verdict, (shot,), f"that of {describe_shot(shown)}")
    worst = min(lost, key=lambda verdict: lost[verdict].mean)
    if Verdict.LATE in lost and lost[Verdict.LATE].mean < lost[worst].mean + NEARLY:
        worst = Verdict.LATE
    return Finding(shot, worst, (shot,))


def in_place(
    found: Finding, rivals: Mapping[Verdict, Contest], places: Mapping[int, Contest], learned: Learned
) -> Finding:
    """A finding on a line, or that lines are out of their place since some shot.

    ``places`` are contests of the right place with those so many columns away. A line next to its place may
    seem dark, or like the next one, but is more like itself out of place than like any of the ``rivals``.
    """
    best = min((each.mean for each in rivals.values() if each.is_told), default=1.0)
    if found.is_wrong and min((each.mean for each in places.values()), default=1.0) > best - NEARLY:
        return found
    told = learned.places.judge(found.shot, places, found.is_wrong)
    if told is not None:
        return displaced(found.shot, told[1], told[0])
    if not found.is_wrong and is_aside(places):
        return replace(found, is_doubtful=True, detail="its line was next to its place")
    return found

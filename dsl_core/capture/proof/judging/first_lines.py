"""Lines of the first setting, judged by their columns: those, white and black are known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from dsl_core.capture.proof.contest import counted
from dsl_core.capture.proof.finding import Finding, Verdict, of_another_pattern
from dsl_core.capture.proof.judging.decision import decide, in_place
from dsl_core.capture.proof.judging.known import Known
from dsl_core.capture.proof.late_colour import FEWEST_VOTES, MOST_MEAN, is_of_another
from dsl_core.capture.proof.lines.line_place import contests_of_sides, moved
from dsl_core.capture.proof.lines.line_shown import line_shown
from dsl_core.capture.proof.prediction import (
    LineBallots,
    Lit,
    ballots_of_lines,
    brightness_of_lines,
    contest_of_lines,
    is_lit_elsewhere,
    is_over_white,
)
from dsl_core.capture.proof.raster import Counts, Floats
from dsl_core.capture.proof.usual_light import FILM_SHARE
from dsl_core.model.conditions import COLOUR_NAMES
from dsl_core.model.plan import Shot


def judge_line(known: Known, shot: Shot, seen: Counts) -> Finding:
    """What a picture of lines shows, which is not remembered yet."""
    lit, wanted = known.lit, known.profile(shot)
    if lit is None or wanted is None:
        return Finding(shot, Verdict.UNTOLD)
    share = brightness_of_lines(seen, lit, wanted, known.noise)
    # Pixels see a share of their own of each colour, which pictures of other colours do not tell.
    is_uniform = _is_uniform(wanted)
    usual = np.float32(FILM_SHARE if is_uniform else known.learned.usual.share(shot))
    profiles = [(verdict, known.profile(rival)) for verdict, rival in known.rivals(shot)]
    rivals = [(verdict, usual * profile) for verdict, profile in profiles if profile is not None]
    # Next to a picture of one colour, white is known from its own, however bright that colour is.
    white = np.ones_like(wanted) if is_uniform else usual * np.ones_like(wanted)
    rivals += [(Verdict.DARK, np.zeros_like(wanted)), (Verdict.OTHER, white)]
    asked = {verdict: ballots_of_lines(seen, lit, usual * wanted, rival) for verdict, rival in rivals}
    contests = {verdict: counted(each.votes) for verdict, each in asked.items()}
    found = decide(shot, contests, share, known.learned, lambda: _line_shown(known, lit, seen, shot))
    if not found.is_wrong and is_lit_elsewhere(seen, lit, wanted):
        return Finding(shot, Verdict.OTHER, (shot,), "it is bright where it should be dark")
    if not found.is_wrong and is_over_white(seen, lit, wanted):
        return Finding(shot, Verdict.OTHER, (shot,), "a part of it is brighter than white")
    wanted = usual * wanted
    places = contests_of_sides(lambda side: contest_of_lines(seen, lit, wanted, moved(wanted, side)))
    found = in_place(found, contests, places, known.learned)
    colour = None if found.is_wrong else _colour_of_another(asked)
    if colour is None:
        return found
    return replace(found, is_doubtful=True, detail=of_another_pattern(colour), colour=colour)


def _is_uniform(profile: Floats) -> bool:
    """Whether a `line_profile` has one colour in all columns."""
    leds = profile.reshape(-1, 3)
    return bool((leds == leds[0]).all())


def _colour_of_another(asked: Mapping[Verdict, LineBallots]) -> str | None:
    """The colour of a picture that seems to be of the line before or after.

    A colour of the projector may come late by itself, and so may packets of a camera that sends colours one
    after the other.
    """
    others = [asked[each] for each in (Verdict.SWAPPED, Verdict.LATE) if each in asked]
    # Of nearly every picture, hardly any pixel votes for them.
    others = [each for each in others if float(np.minimum(each.votes, 0).sum()) < FEWEST_VOTES * MOST_MEAN]
    for colour, name in enumerate(COLOUR_NAMES):
        if any(is_of_another(each.of_colour(colour)) for each in others):
            return name
    return None


def _line_shown(known: Known, lit: Lit, seen: Counts, shot: Shot) -> Shot | None:
    """The shot of the same setting whose line it is that a picture shows."""
    own = [s for s in known.shots if s.setting == shot.setting and s.role != "sentinel"]
    lines = ((each, profile) for each in own if (profile := known.profile(each)) is not None)
    return line_shown(seen, lit, lines, known.plan.projector_size_px[0])

"""Whether projector or camera are one picture late, told by how wrong pictures follow each other."""

from __future__ import annotations

from collections import deque

from dsl_core.capture.proof.finding import Finding, Verdict
from dsl_core.model.plan import Shot

#: After so many wrong pictures on end, projector or camera count as late.
FAILURES = 2
#: Pictures of which nothing can be told are unlike those before them on end within so many shots. None of
#: them is ever right, so that a lamp that flickers now and then would else add up over a scan.
ON_END = 3
#: So many pictures that are late, or a colour of them, within so many shots, with right ones between: a
#: display that drops every so many. Those of which nothing could be told may have been late as well.
LATE_OFTEN, LATE_WITHIN = 3, 64
#: So many pictures that a second one cured within so many shots: most are late in a part.
CURED_OFTEN, CURED_WITHIN = 8, 16
#: Pictures on end that are wrong like this may be late in a part of the picture alone.
IN_PART = (Verdict.TORN, Verdict.EXPOSURE)


class Lateness:
    """Counts wrong pictures, late ones, and those that a second picture cured."""

    def __init__(self) -> None:
        """Nothing was wrong so far."""
        #: Wrong pictures on end.
        self.failures = 0
        #: Whether a colour, or a part of the picture, may be late alone.
        self.has_late_colour = self.is_in_part = False
        self._unlike_at = 0
        self._late_at: deque[int] = deque(maxlen=LATE_OFTEN)
        self._cured_at: deque[int] = deque(maxlen=CURED_OFTEN)

    def count(self, found: Finding) -> None:
        """Count what a picture shows."""
        if found.is_wrong:
            self.failures += 1
            self.is_in_part |= found.verdict in IN_PART
        elif found.verdict is Verdict.RIGHT:
            self.failures, self.is_in_part = 0, False

    def count_late(self, found: Finding) -> None:
        """Count a picture that is late, or a colour of one."""
        self._late_at.append(found.shot.index)
        self.has_late_colour |= bool(found.colour)

    def count_cured(self, found: Finding) -> None:
        """Count a picture that another one of its shot was unlike as one of a run, or as the first of one."""
        shot = found.shot.index
        if found.verdict is Verdict.UNTOLD and shot - self._unlike_at > ON_END:
            self.failures = 0
        self.failures, self._unlike_at = self.failures + 1, shot
        self._cured_at.append(shot)

    def comes_and_goes(self, shot: Shot) -> bool:
        """Whether late pictures have come and gone up to this shot: right ones between say nothing."""
        return len(self._late_at) == LATE_OFTEN and shot.index - self._late_at[0] <= LATE_WITHIN

    def is_told(self, shot: Shot) -> bool:
        """Whether everything counts as late from this shot on."""
        if self.comes_and_goes(shot) or self.failures >= FAILURES:
            return True
        is_cured = len(self._cured_at) == CURED_OFTEN and shot.index - self._cured_at[0] < CURED_WITHIN
        self.is_in_part |= is_cured
        return is_cured

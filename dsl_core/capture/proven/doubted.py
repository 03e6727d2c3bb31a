"""Saved shots that turn out to be wrong with a later one: which they are, and since when."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

from dsl_core.model.plan import Shot

#: A change may begin a little before it shows: so many pictures before one that stays wrong are withdrawn.
JUST_BEFORE = 8
#: So many shots of which nothing could be told are captured again, where that matters afterwards.
MOST_UNTOLD = 32


class DoubtedShots:
    """What was saved and may be wrong, should a picture after it stay so."""

    def __init__(self) -> None:
        """Nothing was saved yet."""
        #: Of these nothing could be told, since a picture last showed its pattern in its usual light.
        self.untold: list[Shot] = []
        self._passed: deque[Shot] = deque(maxlen=MOST_UNTOLD)
        self._recent: deque[Shot] = deque(maxlen=JUST_BEFORE)
        #: What was saved since an old picture, taken again, last looked as it did at first.
        self._since_sound: set[Shot] = set()
        #: What was saved of the first code, until it is whole: its pictures are judged by each other.
        self._of_code: set[Shot] = set()

    def add(self, shot: Shot, is_untold: bool) -> None:
        """A shot was saved; ``is_untold`` if nothing could be told of it."""
        self._recent.append(shot)
        if is_untold and shot not in self.untold:
            self.untold.append(shot)

    def add_alone(self, shot: Shot) -> None:
        """A shot was saved that is judged by itself; with the first, the code before is whole."""
        self._since_sound.add(shot)
        self._of_code.clear()

    def add_code(self, shot: Shot) -> None:
        """A shot of the first code was saved."""
        self._of_code.add(shot)

    def end_code(self) -> None:
        """The first code is whole, and judged by what its pictures are together."""
        self._of_code.clear()

    def trust_untold(self) -> None:
        """A picture showed its pattern in its usual light: so did those of which nothing could be told."""
        self._passed.extend(self.untold)
        self.untold.clear()

    def doubt_passed(self) -> None:
        """A right picture says nothing of those before it: doubt them again."""
        self.untold = [*self._passed, *self.untold]

    def settle_recent(self) -> None:
        """An old picture, taken again, showed its pattern: so did the last ones."""
        self._recent.clear()

    def settle_all(self) -> None:
        """An old picture, taken again, looked as it did at first: nothing has changed since."""
        self._since_sound.clear()

    def withdraw(self, wrong: Iterable[Shot], has_changed: bool) -> list[Shot]:
        """Shots that may be wrong with these, in their order; from now on nothing is doubted.

        ``has_changed`` means that something changed and nobody knows since when: a code of which some
        pictures are older never fits its lines.
        """
        found = {*self.untold, *self._recent, *wrong}
        if has_changed:
            found |= self._since_sound | self._of_code
        for each in (self.untold, self._recent, self._since_sound, self._of_code):
            each.clear()
        return sorted(found, key=lambda shot: shot.index)

"""What a look at all pictures of a scan found, to be kept with it."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from dsl_core.model.base import Record

Sentence = Annotated[str, Field(max_length=2000)]
Sentences = Annotated[tuple[Sentence, ...], Field(max_length=100_000)]


class ScanProof(Record):
    """Of ``judged`` frames: which are ``wrong``, how many are ``untold``, and what ``moved`` between them.

    Untold are frames that show too little to be judged by their pattern.
    """

    judged: int = Field(ge=0)
    untold: int = Field(ge=0)
    wrong: Sentences = ()
    moved: Sentences = ()

    @property
    def doubts(self) -> tuple[str, ...]:
        """A sentence for everything that was found."""
        return (*self.moved, *self.wrong)

    @property
    def not_judged(self) -> str:
        """Of how many pictures nothing can be told, such as ``26 of 150``; empty if of none."""
        return f"{self.untold} of {self.judged}" if self.untold else ""

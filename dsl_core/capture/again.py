"""How a person captures again what is missing or wrong: by resuming a scan, or a step of a calibration."""

from __future__ import annotations

from enum import StrEnum


class Again(StrEnum):
    """What is captured, by what a person does to continue it; frames that were saved are kept either way.

    >>> f"Put back what moved. {Again.STEP.then}"
    'Put back what moved. Then capture this step again.'
    """

    SCAN = "resume the scan"
    STEP = "capture this step again"

    @property
    def then(self) -> str:
        """A sentence that follows other advice."""
        return f"Then {self}."

    @property
    def sentence(self) -> str:
        """The advice alone."""
        return f"{self.capitalize()}."

    @property
    def unchecked(self) -> str:
        """A sentence on how to continue without the check; empty for a step, which is always checked."""
        if self is Again.STEP:
            return ""
        return "To continue all the same, resume the scan without checking that the scene has not moved."

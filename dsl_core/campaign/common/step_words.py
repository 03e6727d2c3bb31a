"""What a scan advises, in the words of a calibration: there is no scan to resume, only a step to capture."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from contextlib import contextmanager

from dsl_core.errors import DslError

#: What a scan says, and what a step says instead; frames that were saved are kept either way.
_WORDS = (
    ("Resume the scan", "Capture this step again"),
    ("resume the scan", "capture this step again"),
    ("the resumed scan captures", "capturing this step again captures"),
    ("then resume.", "then capture this step again."),
)


@contextmanager
def step_words() -> Iterator[None]:
    """Tell errors of a scan that is a step of a calibration in the words of a person who calibrates."""
    try:
        yield
    except DslError as error:
        said = in_step_words(str(error))
        if said == str(error):
            raise
        # A copy keeps what else the error knows, whatever its class.
        told = copy.copy(error)
        told.args = (said,)
        raise told from error


def in_step_words(text: str) -> str:
    """The same advice for a step of a calibration.

    >>> in_step_words("It hangs. Switch it off and on, then resume.")
    'It hangs. Switch it off and on, then capture this step again.'
    """
    for of_scan, of_step in _WORDS:
        text = text.replace(of_scan, of_step)
    return text

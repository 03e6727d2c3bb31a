"""Why no report is written of results that are no longer those on screen. No Qt."""

from __future__ import annotations

CHANGED = "The results have changed while you chose a file. Look at the new figures, then write the report."
REPLACED = (
    "A result was replaced after it had been compared, and is read again. Look at the new figures, then write"
    " the report."
)

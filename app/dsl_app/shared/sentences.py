"""Sentences that several pages show."""

from __future__ import annotations

from dsl_core.errors import DslError

NO_RIG = "No rig is connected. Connect one on the Rig page."


def sentence_of(error: Exception) -> str:
    """What went wrong, for people."""
    return str(error) if isinstance(error, DslError) else f"{type(error).__name__}: {error}"

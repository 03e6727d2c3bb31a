"""The command lines that do what the Calibrate page does."""

from __future__ import annotations

import shlex

from dsl_app.calibrate.state import CampaignFacts
from dsl_app.connection.state import RigChoice


def calibrate_command(name: str, campaign: CampaignFacts | None, rig: RigChoice) -> str:
    """The command of one calibration, of all of them for an empty name.

    A campaign that was begun knows its rig; a new one is told.
    """
    verb = name if name == "selftest" else f"calibrate {name or 'all'}"
    folder = "CAMPAIGN" if campaign is None else shlex.quote(str(campaign.path))
    return f"dsl-scan {verb} {folder} {(rig if campaign is None else campaign.rig).command}".rstrip()

"""One calibration as a command: its campaign, its session, its end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from dsl_core.cli.guidance import ConsoleGuide, figures_json, going_on_with, opened_campaign
from dsl_core.cli.options import parse_options
from dsl_core.cli.output import Output

if TYPE_CHECKING:
    from dsl_core.campaign.session import CalibrationSession


@dataclass(frozen=True)
class Guided:
    """What the command line says of one calibration.

    ``redo`` names steps to capture anew; ``anew`` captures all of them that were captured before.
    """

    name: str
    campaign: Path
    rig: str | None
    option: Sequence[str]
    settings: Sequence[str]
    unattended: bool
    json: bool
    redo: Sequence[str] = ()
    tolerant: bool = False
    anew: bool = False

    def run(self) -> None:
        """Go through the steps that lack captures, fit, and accept; print the figures."""
        from dsl_core.campaign.guide import run_calibration
        from dsl_core.campaign.recipes import load_recipe
        from dsl_core.campaign.session import CalibrationSession

        output = Output(self.json)
        command = f"dsl-scan {self._verb} {self.campaign}"
        settings = {self.name: parse_options(self.settings)}
        load_recipe(self.name, settings[self.name])  # wrong settings are told before anything is written
        with (
            going_on_with(command),
            opened_campaign(self.campaign, self.rig, parse_options(self.option), settings) as (
                campaign,
                devices,
            ),
        ):
            recipe = load_recipe(self.name, campaign.info.settings.get(self.name))
            session = CalibrationSession(recipe, devices, campaign)
            before = session.accepted()
            redo = self._captured(session) if self.anew else self.redo
            guide = ConsoleGuide(output, self.unattended, self.tolerant)
            with output.progress() as progress:
                accepted = run_calibration(session, guide, progress, redo)
        if accepted == before:
            output.say(
                f"{accepted.title} was accepted before ({accepted.accepted[:16]}); --redo STEP captures anew."
            )
        else:
            output.say(f"{accepted.title} is accepted.")
        output.put(name=accepted.name, accepted=accepted.accepted, figures=figures_json(accepted.figures))
        output.put(campaign=self.campaign)
        output.finish()

    @property
    def _verb(self) -> str:
        return self.name if self.name == "selftest" else f"calibrate {self.name}"

    def _captured(self, session: CalibrationSession) -> tuple[str, ...]:
        return tuple(each.step.key for each in session.statuses() if each.state == "captured")

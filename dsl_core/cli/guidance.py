"""A person at the terminal, or nobody, beside a calibration: what is asked and told."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from dsl_core.cli.output import Output
from dsl_core.errors import CalibrationError, Cancelled

if TYPE_CHECKING:
    from dsl_core.campaign.common.recipe import Step
    from dsl_core.campaign.session import CalibrationSession
    from dsl_core.devices.base import DeviceRig
    from dsl_core.io.campaign_folder import CampaignFolder
    from dsl_core.model.calibration.accepted import AcceptedCalibration
    from dsl_core.model.figure import Figure


@dataclass(frozen=True)
class ConsoleGuide:
    """Asks on standard error and reads answers from standard input, so that JSON stays alone on output.

    ``unattended`` takes every target as placed; ``tolerant`` goes on although figures are outside limits.
    """

    output: Output
    unattended: bool = False
    tolerant: bool = False

    def begins(self, session: CalibrationSession, missing: int) -> None:
        """Say what is to come, and why captures that are there are not good enough."""
        steps = len(session.steps)
        self.output.say(f"{session.recipe.title}: {missing} of {steps} steps to capture, then the fit.")
        for each in session.statuses():
            if each.state == "refused":
                self.output.say(f"  {each.step.title} is captured anew: {each.reason}")

    def place(self, step: Step) -> None:
        """Ask a person to place the target."""
        ask = f"{step.title}. {step.instruction}"
        if self.unattended:
            self.output.say(ask)
        else:
            answer(self.output, f"{ask} Then press Enter (Ctrl-C stops, everything captured is kept): ")

    def looked(self, step: Step, figures: Sequence[Figure]) -> bool:
        """Tell what a look found; where it is not good, a person decides."""
        from dsl_core.model.figure import failures

        wrong = failures(tuple(figures))
        told = ", ".join(map(str, figures)) or "nothing to measure"
        self.output.say(f"  {step.title}: {told}{' - not good yet' if wrong else ''}")
        if not wrong or self.tolerant:
            return True
        advice = " ".join(f"{figure}: {figure.advice}" for figure in wrong)
        if self.unattended:
            raise CalibrationError(f"The step {step.title!r} does not look right: {advice}")
        said = answer(self.output, f"{advice} Enter looks again, 'go' goes on as it is: ")
        return said.strip().lower() == "go"

    def judge(self, fitted: AcceptedCalibration) -> bool:
        """Print the key figures; accept when all are within their limits, or anything if tolerant."""
        from dsl_core.model.figure import failures

        print_figures(self.output, fitted.figures)
        return self.tolerant or not failures(fitted.figures)


def print_figures(output: Output, figures: Sequence[Figure]) -> None:
    """A table of figures with their limits and verdicts."""
    rows = [(str(figure), figure.limits, verdict(figure)) for figure in figures]
    output.table(("figure", "wanted", ""), rows)


def verdict(figure: Figure) -> str:
    """``reached``, or ``missed`` with what to do; nothing for a figure without limits."""
    if figure.low is None and figure.high is None:
        return ""
    return "reached" if figure.passed else f"missed: {figure.advice}"


def figures_json(figures: Sequence[Figure]) -> list[dict[str, object]]:
    """Figures for a program."""
    return [{**figure.model_dump(), "passed": figure.passed} for figure in figures]


@contextmanager
def opened_campaign(
    folder: Path, rig: str | None, options: dict[str, str], settings: dict[str, dict[str, str]]
) -> Iterator[tuple[CampaignFolder, DeviceRig]]:
    """A campaign that no other process writes, and the open devices of its rig."""
    from dsl_core.devices.registry import open_rig
    from dsl_core.io.campaign_folder import CampaignFolder
    from dsl_core.io.scan.lock import FolderLock

    campaign = CampaignFolder.prepare(folder, rig, options, settings)
    # Devices that do not open must not leave a campaign of theirs behind.
    with open_rig(campaign.info.rig, campaign.info.options) as devices:
        folder.mkdir(parents=True, exist_ok=True)
        lock = FolderLock(folder / "lock")
        try:
            campaign.save()
            yield campaign, devices
        finally:
            lock.release()


@contextmanager
def going_on_with(command: str) -> Iterator[None]:
    """Ctrl-C ends in the command that goes on."""
    try:
        yield
    except (KeyboardInterrupt, Cancelled):
        raise Cancelled(f"Stopped; everything captured is stored. Go on with: {command}") from None


def answer(output: Output, question: str) -> str:
    """The line a person answers; raises `CalibrationError` when there is nobody."""
    line = output.ask(question)
    if not line:
        raise CalibrationError(
            "Nobody answers: standard input has ended. Run it in a terminal, or with --yes where every target"
            " is placed by itself."
        )
    return line

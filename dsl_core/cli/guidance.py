"""Calibrations at the terminal: what a person is asked and told, and one calibration as a command."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from dsl_core.cli.options import parse_options
from dsl_core.cli.output import Output
from dsl_core.errors import CalibrationError, Cancelled, DeviceError
from dsl_core.words import quoted

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

    ``campaign`` is its folder, None if that is not kept. ``unattended`` assumes that every target is placed;
    ``tolerant`` continues although figures are outside their limits.
    """

    output: Output
    campaign: Path | None
    unattended: bool = False
    tolerant: bool = False

    def begins(self, session: CalibrationSession, missing: int) -> None:
        """Say what follows, why existing captures are not good enough, and what they were made without."""
        steps = len(session.steps)
        self.output.say(f"{session.recipe.title}: {missing} of {steps} steps to capture, then the fit.")
        for each in session.statuses():
            if each.state == "refused":
                self.output.say(f"  {each.step.title} is captured again: {each.reason}")
            elif each.reason:
                self.output.say(f"  {each.step.title}: {each.reason} (--redo {each.step.key})")

    def place(self, step: Step) -> None:
        """Ask a person to place the target."""
        ask = f"{step.title}. {step.instruction}"
        if self.unattended:
            self.output.say(ask)
        else:
            kept = "" if self.campaign is None else " (Ctrl-C stops; everything captured is kept)"
            answer(self.output, f"{ask} Then press Enter{kept}: ")

    def looked(self, step: Step, figures: Sequence[Figure]) -> bool:
        """Report what a look found; where it is not good, a person decides."""
        from dsl_core.model.figure import failures

        wrong = failures(tuple(figures))
        told = ", ".join(map(str, figures)) or "nothing to measure"
        self.output.say(f"  {step.title}: {told}{' - not good yet' if wrong else ''}")
        if not wrong or self.tolerant:
            return True
        advice = " ".join(f"{figure}: {figure.advice}" for figure in wrong)
        if self.unattended:
            raise CalibrationError(f"The step {step.title!r} does not look right: {advice}")
        said = answer(self.output, f"{advice} Press Enter to look again, or type 'go' to continue anyway: ")
        return said.strip().lower() == "go"

    def judge(self, fitted: AcceptedCalibration) -> bool:
        """Print the key figures; accept when all are within their limits, or anything if tolerant.

        Raises `CalibrationError` with the commands that help.
        """
        from dsl_core.campaign.guide import not_accepted
        from dsl_core.model.figure import failures

        print_figures(self.output, fitted.figures)
        if self.tolerant or not failures(fitted.figures):
            return True
        remedy = "Then run the command again."
        if self.campaign is not None and fitted.name != "selftest":
            remedy = (
                f"Capture a step again with 'dsl-scan calibrate {fitted.name} {quoted(self.campaign)}"
                " --redo STEP', or accept with --accept-failed."
            )
        raise CalibrationError(f"{not_accepted(fitted, kept=self.campaign is not None)} {remedy}")


def print_figures(output: Output, figures: Sequence[Figure]) -> None:
    """A table of figures with their limits and verdicts."""
    rows = [(str(figure), figure.limits, verdict(figure)) for figure in figures]
    output.table(("figure", "limits", ""), rows)


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
    folder: Path,
    rig: str | None,
    options: dict[str, str],
    settings: dict[str, dict[str, str]],
    judge: Callable[[CampaignFolder, DeviceRig], object] | None = None,
) -> Iterator[tuple[CampaignFolder, DeviceRig]]:
    """A campaign that no other process writes, and the open devices of its rig.

    What ``judge`` refuses is not written down: the next command would find the same setting.
    """
    from dsl_core.devices.registry import open_rig
    from dsl_core.io.campaign_folder import CampaignFolder, take_campaign

    campaign = CampaignFolder.prepare(folder, rig, options, settings)
    # Devices that do not open must not leave a campaign of theirs behind.
    with open_rig(campaign.info.rig, campaign.info.options) as devices:
        folder.mkdir(parents=True, exist_ok=True)
        lock = take_campaign(folder)
        try:
            if judge is not None:
                judge(campaign, devices)
            campaign.save()
            yield campaign, devices
        finally:
            lock.release()


@contextmanager
def resumed_by(command: str | None) -> Iterator[None]:
    """Turn Ctrl-C into a sentence with the command that resumes, and add it to that of a lost device.

    None where nothing is kept.
    """
    how = (
        "Run the command again."
        if command is None
        else f"Everything captured is kept. Resume with: {command}"
    )
    try:
        yield
    except (KeyboardInterrupt, Cancelled):
        raise Cancelled(f"Stopped. {how}") from None
    except DeviceError as error:
        raise type(error)(f"{error} {how}") from error


def answer(output: Output, question: str) -> str:
    """The line that a person types; raises `CalibrationError` when standard input has ended."""
    line = output.ask(question)
    if not line:
        raise CalibrationError(
            "There is no answer: standard input has ended. Run the command in a terminal, or add --yes if"
            " every target is placed automatically."
        )
    return line


def run_guided(
    name: str,
    campaign: Path,
    rig: str | None,
    option: Sequence[str],
    set_: Sequence[str],
    yes: bool,
    json: bool,
    redo: Sequence[str] = (),
    accept_failed: bool = False,
    again: bool = False,
    kept: bool = True,
) -> None:
    """Go through the steps of a calibration that lack captures, fit, and accept; print the figures.

    ``redo`` names steps to capture again; ``again`` repeats every step that was captured before. A campaign
    that is not ``kept`` is gone when this ends.
    """
    from dsl_core.campaign.guide import run_calibration
    from dsl_core.campaign.recipes import load_recipe
    from dsl_core.campaign.session import CalibrationSession

    output, settings = Output(json), {name: parse_options(set_)}
    command = f"dsl-scan {name if name == 'selftest' else f'calibrate {name}'} {quoted(campaign)}"
    load_recipe(name, settings[name])  # wrong settings are reported before anything is written

    def session_of(folder: CampaignFolder, devices: DeviceRig) -> CalibrationSession:
        found = CalibrationSession(load_recipe(name, folder.info.settings.get(name)), devices, folder)
        found.statuses()  # settings that these devices do not take are refused
        return found

    with (
        # Before the devices are open there is nothing to resume.
        opened_campaign(campaign, rig, parse_options(option), settings, session_of) as (folder, devices),
        resumed_by(command if kept else None),
    ):
        session = session_of(folder, devices)
        before = session.accepted()
        if again:
            redo = [each.step.key for each in session.statuses() if each.state == "captured"]
        guide = ConsoleGuide(output, campaign if kept else None, yes, accept_failed)
        with output.progress() as progress:
            accepted = run_calibration(session, guide, progress, redo)
    if accepted == before:
        output.say(
            f"{accepted.title} was accepted before ({accepted.accepted[:16]}); --redo STEP captures a"
            " step again."
        )
    else:
        output.say(f"{accepted.title} is accepted.")
    output.put(name=accepted.name, accepted=accepted.accepted, figures=figures_json(accepted.figures))
    if kept:
        output.put(campaign=campaign)
    output.finish()

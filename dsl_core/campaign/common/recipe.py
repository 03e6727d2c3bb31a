"""What a calibration is made of: steps with a target each, a look, a capture, a fit.

A recipe knows the order and the judgement of one calibration; it holds no state. What was captured lies in
the folder of its step, so that a calibration that was interrupted goes on where it stood.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from dsl_core.devices.base import DeviceRig
from dsl_core.model.base import Record
from dsl_core.model.figure import Figure
from dsl_core.model.placement import Placement
from dsl_core.model.rig import Rig
from dsl_core.progress import Progress


@dataclass(frozen=True)
class Step:
    """One placement of a target and what is captured of it.

    ``key`` names the folder of the captures (letters, digits, ``-``, ``.``); ``instruction`` tells a person
    in a sentence or two what to place and how.
    """

    key: str
    title: str
    instruction: str
    placement: Placement


@dataclass(frozen=True)
class Bench:
    """What a recipe works with.

    ``rig`` is what is known so far, nominal where nothing was measured yet. ``folder`` is the recipe's own;
    each step has a folder in it.
    """

    devices: DeviceRig
    folder: Path
    rig: Rig

    def step_folder(self, step: Step) -> Path:
        """Where the captures of a step lie; it need not exist."""
        return self.folder / step.key


class Recipe(Protocol):
    """One kind of calibration. All that raises, raises `CalibrationError` that names the step concerned."""

    @property
    def name(self) -> str:
        """Name on the command line and of the folder, such as ``bandpass``."""

    @property
    def title(self) -> str:
        """Title of the wizard, such as ``Bandpass filters``."""

    @property
    def needs(self) -> tuple[str, ...]:
        """Names of the calibrations that must be accepted before."""

    @property
    def record_type(self) -> type[Record]:
        """The record that `fit` makes, which is kept as JSON."""

    def steps(self, bench: Bench) -> tuple[Step, ...]:
        """The steps in their order."""

    def look(self, bench: Bench, step: Step) -> tuple[Figure, ...]:
        """Check with a few frames, which are not kept, that the target is right: found, even, unsaturated.

        Costs at most a second or two, so that a wizard can repeat it while a person moves the target.
        """

    def is_captured(self, bench: Bench, step: Step) -> bool:
        """Whether the captures of a step are complete."""

    def capture(self, bench: Bench, step: Step, progress: Progress) -> None:
        """Capture a step into its folder; goes on with captures that an earlier call left unfinished."""

    def fit(self, bench: Bench, progress: Progress) -> Record:
        """Calibrate from the captures of all steps; the devices are not used."""

    def figures(self, record: Record) -> tuple[Figure, ...]:
        """The key figures of a fit against their limits."""

    def apply(self, record: Record, rig: Rig) -> Rig:
        """What is known of the rig once this calibration is accepted."""

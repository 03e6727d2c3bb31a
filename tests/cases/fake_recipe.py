"""A calibration of nothing much: steps that scan a few uniform colours, and a fit that means them."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field

import numpy as np

from dsl_core.campaign.common.recipe import Bench, Recipe, Step
from dsl_core.errors import CalibrationError
from dsl_core.model.base import Record
from dsl_core.model.figure import Figure
from dsl_core.model.placement import Placement
from dsl_core.model.plan import CapturePlan, Columns, NoCode, Setting
from dsl_core.model.rig import Rig
from dsl_core.progress import Progress


class Brightness(Record):
    """Mean of each step, DN."""

    means_dn: tuple[float, ...]


@dataclass
class FakeRecipe(Recipe[Brightness]):
    """A recipe without targets; the fields make it fail or differ where a test wants that."""

    title = "Brightness"
    record_type = Brightness

    name: str = "fake"
    needs: tuple[str, ...] = ()
    keys: tuple[str, ...] = ("dim", "bright")
    scale: float = 2.0
    largest_dn: float = 4000.0
    good_look: int = 1
    bad_steps: set[str] = field(default_factory=set)
    placement: Placement = field(default_factory=lambda: Placement(target="as it is"))
    #: What looks find, the first first; the last one is found from then on.
    points_px: tuple[tuple[tuple[float, float], ...], ...] = ()
    looks: list[str] = field(default_factory=list)
    captured: list[str] = field(default_factory=list)
    done_before: tuple[str, ...] = ()
    level: float = 1.0

    def steps(self, bench: Bench) -> tuple[Step, ...]:
        """One a key."""
        return tuple(
            Step(key, f"{key} picture", f"Place the {key} target.", self.placement) for key in self.keys
        )

    def look(self, bench: Bench, step: Step) -> tuple[Figure, ...]:
        """Count the looks; it takes ``good_look`` of them to see the target right."""
        self.looks.append(step.key)
        if self.points_px:
            bench.found(np.array(self.points_px[min(len(self.looks), len(self.points_px)) - 1]))
        advice = "Move the target closer."
        return (Figure(name="looks", value=len(self.looks), unit="", low=self.good_look, advice=advice),)

    def acts_at_capture(self, step: Step) -> dict[str, float]:
        """The level, of all but the first step."""
        return {} if step.key == self.keys[0] else {"level": self.level}

    def capture(self, bench: Bench, step: Step, progress: Progress) -> None:
        """Scan one colour, brighter from step to step."""
        level = (self.keys.index(step.key) + 1) / len(self.keys)
        width = bench.devices.projector.info.width_px
        plan = CapturePlan(
            name=step.key,
            code=NoCode(),
            spectral=Columns(levels=(((level,) * 3,) * width,)),
            settings=(Setting(exposure_ms=5.0, level=self.level),),
            code_settings=(0,),
        )
        bench.scan(step, lambda: plan, progress)
        self.captured.append(step.key)
        if step.key in self.bad_steps:
            raise CalibrationError(f"The {step.key} picture shows the wrong target. Place the right one.")

    def fit(self, bench: Bench, progress: Progress) -> Brightness:
        """Read the frames of all steps."""
        means = []
        for step in self.steps(bench):
            reader = bench.scan_of(step)
            shot = next(shot for shot in reader.plan.shots() if shot.role == "spectral")
            means.append(float(reader.read(shot).mean()))
        progress.report("fit", 1, 1)
        return Brightness(means_dn=tuple(means))

    def figures(self, record: Brightness, done: Collection[str] = ()) -> tuple[Figure, ...]:
        """The brightest mean against its limit."""
        advice = "Open the aperture."
        self.done_before = tuple(done)
        return (
            Figure(
                name="brightest",
                value=max(record.means_dn),
                unit="DN",
                std=0.5,
                high=self.largest_dn,
                advice=advice,
            ),
        )

    def apply(self, record: Brightness, rig: Rig) -> Rig:
        """Change the white scale by a known factor."""
        return rig.model_copy(update={"white_scale": rig.white_scale * self.scale})


@dataclass
class FakeSelfTest(FakeRecipe):
    """Stands for the self-test."""

    name: str = "selftest"


@dataclass
class FakeGeometry(FakeRecipe):
    """Stands for a calibration that needs the self-test."""

    name: str = "geometry"
    needs: tuple[str, ...] = ("selftest",)
    keys: tuple[str, ...] = ("pose",)

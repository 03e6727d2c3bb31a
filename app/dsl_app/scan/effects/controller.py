"""The effects that the simulated rig renders: previewed for the current scene, then applied. No Qt."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dsl_app.connection.controller import RigController
from dsl_app.connection.state import Link, RigChoice
from dsl_app.scan.effects.state import EffectChoice, EffectsState, EffectsView
from dsl_app.scan.state import ScanState
from dsl_app.shared.jobs.base import Job, JobRunner
from dsl_app.shared.notify import Notifier
from dsl_core.devices.base import DeviceRig
from dsl_core.model.plan import CapturePlan
from dsl_core.progress import Progress
from dsl_core.simulation.effects.tolerance import ONE_DN, Tolerance

if TYPE_CHECKING:
    from dsl_core.simulation.world import World

EFFECTS, TOLERANCE = "effects", "tolerance"


class EffectsController:
    """Weighs the effects of the current scene; `apply` reconnects the twin with a choice."""

    def __init__(
        self,
        state: EffectsState,
        scan: ScanState,
        rig: RigController,
        runner: JobRunner,
        notifier: Notifier,
    ) -> None:
        self.state, self._scan, self._rig, self._runner, self._notifier = state, scan, rig, runner, notifier
        self._asked = (EffectChoice.USUAL.value, ONE_DN)
        self._turn = 0
        self._stops = [rig.state.devices.follow(self._take_rig), rig.state.link.follow(self._take_link)]

    def _take_rig(self, devices: DeviceRig | None) -> None:
        options = dict(self._rig.state.choice.value.options)
        state = self.state
        state.view.set(None)
        if devices is None and self._rig.state.link.value is Link.OPENING:
            return  # the next rig may be simulated, too
        world = _world_of(devices)
        state.offered.set(world is not None)
        state.in_use.set(options.get(EFFECTS, EffectChoice.USUAL.value))
        state.tolerance.set(ONE_DN if world is None else world.request.tolerance)
        self._asked = (state.in_use.value, state.tolerance.value)

    def _take_link(self, link: Link) -> None:
        # Connecting the requested rig may have failed.
        if link is Link.CLOSED and self._rig.state.devices.value is None:
            self.state.offered.set(False)

    def look(self, choice: str, tolerance: Tolerance) -> None:
        """Show what a choice renders, and what the other effects would change and cost."""
        self._asked = choice, tolerance
        world, plan = _world_of(self._rig.state.devices.value), self._scan.plan.value
        if world is None:
            return
        self._turn += 1
        turn = self._turn

        def work(progress: Progress) -> EffectsView:
            progress.report("weigh effects", 0, 0)
            return view_of(world, choice, tolerance, plan)

        def done(view: EffectsView) -> None:
            # After several quick clicks the last choice wins.
            if turn == self._turn:
                self.state.view.set(view)

        def ended() -> None:
            if turn == self._turn:
                self.state.busy.set(False)

        self.state.busy.set(True)
        self._runner.submit(Job("Weigh the effects", work, done, is_minor=True, on_ended=ended))

    def look_again(self) -> None:
        """Show the last choice again, for the current plan."""
        self.look(*self._asked)

    def apply(self, choice: str, tolerance: Tolerance) -> None:
        """Let the twin render a choice."""
        if self._scan.phase.value.is_busy:
            self._notifier.tell("info", "A scan is running. Wait until it ends, then change the effects.")
            return
        now = self._rig.state.choice.value
        options = {key: value for key, value in now.options if key not in (EFFECTS, TOLERANCE)}
        if choice != EffectChoice.USUAL.value:
            options[EFFECTS] = choice
        if choice == EffectChoice.AUTO.value and tolerance != ONE_DN:
            # Options of a rig are separated by spaces.
            options[TOLERANCE] = str(tolerance).replace(" ", "")
        self._rig.connect(RigChoice(now.name, tuple(options.items())))

    def close(self) -> None:
        """Disconnect from the rig's state."""
        for stop in self._stops:
            stop()


def _world_of(devices: DeviceRig | None) -> World | None:
    """The simulated world of a rig; None for real devices."""
    from dsl_core.simulation.sim_devices import SimCamera

    if devices is None or not isinstance(devices.camera, SimCamera):
        return None
    return devices.camera.world


def view_of(world: World, choice: str, tolerance: Tolerance, plan: CapturePlan) -> EffectsView:
    """What a world would render with a choice; the world itself is not changed."""
    from dsl_core.simulation.effects.catalogue import Choice
    from dsl_core.simulation.rendered_scene import EffectRequest

    request = EffectRequest(Choice.of(choice), tolerance, plan.settings)
    return EffectsView(world.effect_plan(request), plan.shot_count)

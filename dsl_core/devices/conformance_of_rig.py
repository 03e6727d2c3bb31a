"""What a rig says of its parts, and its hand: promises of `RigConformance` beyond those of its devices."""

from __future__ import annotations

import numpy as np

from dsl_core.devices.base import DeviceRig
from dsl_core.devices.plausible import require_transmission
from dsl_core.errors import DslError
from dsl_core.model.placement import Placement


def require(holds: bool, sentence: str) -> None:
    """Fail a test with a sentence; pytest does not take apart assertions of other packages."""
    if not holds:
        raise AssertionError(sentence)


class RigParts:
    """Tests of ``nominal``, ``filters``, ``place`` with its company, and ``sleep``."""

    def open_rig(self) -> DeviceRig:
        """Open the rig under test."""
        raise NotImplementedError("say in the subclass how the rig is opened")

    def test_rig_nominal_describes_its_devices(self) -> None:
        """What data sheets say has the shape of these devices, both colours' curves, and some order."""
        with self.open_rig() as rig:
            known, camera, projector = rig.nominal, rig.camera.info, rig.projector.info
            if known is None:
                return
            for what, lens, width, height in (
                ("camera", known.camera, camera.width_px, camera.height_px),
                ("projector", known.projector, projector.width_px, projector.height_px),
            ):
                shapes = lens.width_px / lens.height_px, width / height
                require(
                    abs(shapes[0] / shapes[1] - 1) < 0.02,
                    f"the nominal {what} is {lens.width_px} x {lens.height_px} px, of another shape than the"
                    f" {width} x {height} px of the device",
                )
                field = lens.width_px / lens.fx_px
                require(0.02 < field < 6, f"the nominal {what} has a focal length of {lens.fx_px:g} px")
            told = (known.sensor.bayer, known.sensor.bit_depth)
            require(
                told == (camera.bayer, camera.bit_depth),
                f"the nominal sensor is {told[0]} of {told[1]} bits, the camera {camera.bayer} of"
                f" {camera.bit_depth} bits",
            )
            orders = set(known.efficiency)
            require(bool(orders & {1, -1}), f"the nominal orders {sorted(orders)} include neither 1 nor -1")
            if 0 in orders:
                values = known.efficiency[0].values
                require(set(values) == {1.0}, "the efficiency of order 0 is one: the others are shares of it")
            lines = known.film.lines_per_mm
            require(20 < lines < 3000, f"{lines:g} lines per mm are not those of a diffraction film")
            curves = (*known.response, *known.emission, *known.efficiency.values())
            for curve in curves:
                inside = curve.at(np.linspace(430.0, 660.0, 24))
                require(bool((inside >= 0).all() and inside.max() > 0), "a nominal curve is negative or zero")

    def test_rig_filters_are_transmissions(self) -> None:
        """Each filter passes a share of the light, most of it near its nominal centre."""
        with self.open_rig() as rig:
            for nm, curve in rig.filters.items():
                values, at = np.array(curve.values), np.array(curve.wavelengths_nm)
                require_transmission(curve, nm)
                peak = float(at[values.argmax()])
                require(abs(peak - nm) < 40, f"the filter of {nm:g} nm passes most at {peak:g} nm")

    def test_rig_places_targets_and_puts_them_back(self) -> None:
        """What calibrations ask for is placed, twice alike, or refused with `DeviceError`; then put back."""
        with self.open_rig() as rig:
            if rig.place is None:
                return
            require(rig.put_back is not None, "a rig with place needs put_back")
            require(rig.standing is not None, "a rig with place needs standing, to say what it placed")
            assert rig.put_back is not None
            assert rig.standing is not None
            before = rig.standing()
            require(bool(before.strip()), "standing says nothing")
            known = rig.calibration or rig.nominal
            where: dict[str, float | str] = {} if known is None else {"depth_mm": known.usual_depth_mm}
            asked = [
                Placement(target="nothing", film=False),
                Placement(target="spectralon", film=False, options=where),
                Placement(target="spectralon", film=True, options=where),
                Placement(target="spectralon", film=True, options=where),
                *(Placement(target="as it is", film=True, filter_nm=nm) for nm in list(rig.filters)[:2]),
            ]
            said = {}
            for placement in asked:
                try:
                    rig.place(placement)
                except DslError as error:
                    require(len(str(error)) > 20, f"{placement.target} is refused without saying why")
                else:
                    said[placement.model_dump_json()] = rig.standing()
            require(bool(said), "place refuses everything; leave it out, so that a person is asked")
            require(all(each.strip() for each in said.values()), "standing says nothing after place")
            rig.put_back()
            rig.put_back()
            after = rig.standing()
            require(after == before, f"put_back left {after!r}; before, {before!r} stood there")

    def test_rig_waits_as_its_clock_does(self) -> None:
        """A rig's own ``sleep`` takes seconds and returns."""
        with self.open_rig() as rig:
            if rig.sleep is not None:
                rig.sleep(0.0)

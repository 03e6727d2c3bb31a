"""From which dose on the proof notices a fault: what it says of scans with ever more of one thing wrong.

``python -m tests.capture.kept_figures`` keeps that as it is now.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.proof.finding import Finding
from dsl_core.capture.proof.report import SeenFrames
from dsl_core.capture.proof.verifier import FrameProof
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, ScanLines, Sentinels, Setting, Shot
from tests.cases.kept_figures import Figures, keep
from tests.cases.rendered_rig import RenderedScene, render, token_image

Picture = NDArray[np.float32]
NUMBER = re.compile(r"\d+\.\d+|\d+")
#: Scans of a comb at two settings, and of single lines with pictures that are captured again.
PLANS = {
    "comb": (CapturePlan(code=GrayCode(rows=False), spectral=LineComb(step_px=4, period_px=64)), "box"),
    "lines": (
        CapturePlan(
            spectral=ScanLines(width_px=16, step_px=16),
            settings=(Setting(exposure_ms=500 / 3, level=0.2),),
            code_settings=(0,),
            sentinels=Sentinels(every=10),
        ),
        "color-checker",
    ),
}


@dataclass
class Scan:
    """Pictures of a whole scan by the index of their shot, DN, before they are rounded."""

    scene: RenderedScene
    pictures: dict[int, Picture]

    @property
    def shots(self) -> tuple[Shot, ...]:
        """What was captured, in that order."""
        return tuple(self.scene.plan.shots())

    def of(self, *roles: str) -> list[Shot]:
        """The shots of some roles."""
        return [shot for shot in self.shots if shot.role in roles]

    def black(self, shot: Shot) -> Picture:
        """What the camera sees without a pattern, with the exposure of a shot."""
        found = next(each for each in self.of("black") if each.setting == shot.setting)
        return self.pictures[found.index]

    def copy(self) -> Scan:
        """The same pictures, to be spoiled."""
        return Scan(self.scene, {index: picture.copy() for index, picture in self.pictures.items()})

    def counts(self) -> Iterator[tuple[Shot, NDArray[np.uint16]]]:
        """Every shot with what the camera delivers."""
        full = self.scene.calibration.sensor.full_scale_dn
        for shot in self.shots:
            yield shot, np.clip(np.rint(self.pictures[shot.index]), 0, full).astype(np.uint16)


#: Changes the picture of a shot by a dose.
Spoil = Callable[[Scan, Shot, float], None]


@cache
def _clean(name: str) -> Scan:
    plan, scene = PLANS[name]
    rendered = render(plan, scene=scene, size="64x48")
    rig, pictures = rendered.open(3), {}
    for shot in rendered.plan.shots():
        rig.camera.configure(shot.exposure_ms)
        rig.projector.show(token_image(rendered.plan, shot))
        pictures[shot.index] = rig.camera.snap().pixels.astype(np.float32)
    return Scan(rendered, pictures)


def _brighter(scan: Scan, shot: Shot, dose: float) -> None:
    black = scan.black(shot)
    scan.pictures[shot.index] = black + (scan.pictures[shot.index] - black) * np.float32(1 + dose)


def _dimmer(scan: Scan, shot: Shot, dose: float) -> None:
    _brighter(scan, shot, -dose)


def _late(scan: Scan, shot: Shot, dose: float) -> None:
    before = scan.pictures[max(shot.index - 1, 0)]
    scan.pictures[shot.index] += np.float32(dose) * (before - scan.pictures[shot.index])


def _torn(scan: Scan, shot: Shot, dose: float) -> None:
    rows = round(len(scan.pictures[shot.index]) * (1 - dose))
    scan.pictures[shot.index][rows:] = scan.pictures[max(shot.index - 1, 0)][rows:]


def _lit(scan: Scan, shot: Shot, dose: float) -> None:
    scan.pictures[shot.index] += np.float32(100 * dose)


def _noisy(scan: Scan, shot: Shot, dose: float) -> None:
    rng = np.random.Generator(np.random.SFC64(shot.index))
    picture = scan.pictures[shot.index]
    picture += np.float32(100 * dose) * rng.standard_normal(picture.shape, np.float32)


def _hidden(scan: Scan, shot: Shot, dose: float) -> None:
    level = np.float32(scan.scene.calibration.sensor.black_level_dn)
    part = scan.pictures[shot.index][12:36, 16:48]
    part += np.float32(dose) * (level - part)


def _window(scan: Scan, shot: Shot, dose: float) -> None:
    scan.pictures[shot.index][20:26, 28:36] += np.float32(2000 * dose)


def _moved(scan: Scan, shot: Shot, dose: float) -> None:
    picture, share = scan.pictures[shot.index], np.float32(4 * dose)
    whole, part = int(share), share - int(share)
    one, other = np.roll(picture, 2 * whole, 1), np.roll(picture, 2 * whole + 2, 1)
    scan.pictures[shot.index] = one + (other - one) * part


def _one_colour(scan: Scan, shot: Shot, dose: float) -> None:
    black = scan.black(shot)
    part, dark = scan.pictures[shot.index][::2, ::2], black[::2, ::2]
    part -= np.float32(dose) * (part - dark)


def _half_of_sensor(scan: Scan, shot: Shot, dose: float) -> None:
    scan.pictures[shot.index][:, 32:] += np.float32(30 * dose)


def _grey_black(scan: Scan, shot: Shot, dose: float) -> None:
    white = next(each for each in scan.of("white") if each.setting == shot.setting)
    light = _clean_light(scan, white)
    scan.pictures[shot.index] += np.float32(0.03 * dose) * light


def _clean_light(scan: Scan, white: Shot) -> Picture:
    clean = next(each for each in map(_clean, PLANS) if each.scene is scan.scene)
    return clean.pictures[white.index] - clean.black(white)


def _curved(scan: Scan, shot: Shot, dose: float) -> None:
    level = np.float32(scan.scene.calibration.sensor.black_level_dn)
    full = np.float32(scan.scene.calibration.sensor.full_scale_dn) - level
    share = np.maximum(scan.pictures[shot.index] - level, 0) / full
    scan.pictures[shot.index] = level + full * share ** np.float32(1 - dose)


def _interlaced(scan: Scan, shot: Shot, dose: float) -> None:
    before = scan.pictures[max(shot.index - 1, 0)]
    for row in (2, 3):
        part = scan.pictures[shot.index][row::4]
        part += np.float32(dose) * (before[row::4] - part)


#: Faults of single pictures: each dose spoils another picture of a scan.
SINGLE: Mapping[str, Spoil] = {
    "brighter": _brighter,
    "dimmer": _dimmer,
    "late": _late,
    "torn": _torn,
    "lit": _lit,
    "noisy": _noisy,
    "hidden": _hidden,
    "window": _window,
    "moved": _moved,
}
#: Doses, ever larger by less than a half: another limit makes another dose the first that is noticed.
DOSES = tuple(float(f"{0.01 * 1.38**n:.2g}") for n in range(14))
#: Faults of many pictures: the roles of those that are spoiled alike, and the doses that are tried.
LASTING: Mapping[str, tuple[Spoil, tuple[str, ...], Sequence[float]]] = {
    "code brighter": (_brighter, ("code",), (0.02, 0.03, 0.04, 0.06)),
    "lines brighter": (_brighter, ("spectral",), (0.04, 0.055, 0.08, 0.12)),
    "lines dimmer": (_dimmer, ("spectral",), (0.04, 0.055, 0.08, 0.3)),
    "white brighter": (_brighter, ("white",), (0.03, 0.06)),
    "colour missing": (_one_colour, ("code", "spectral", "white", "sentinel"), (0.8, 0.95, 0.999)),
    "sensor in halves": (_half_of_sensor, ("code", "spectral", "white", "black", "sentinel"), (0.09, 0.13)),
    "grey black": (_grey_black, ("black", "code", "spectral", "sentinel"), (1.0, 1.4, 2.0, 3.0)),
    "curved": (_curved, ("code", "spectral", "white", "black", "sentinel"), (0.05, 0.1, 0.2)),
    "interlaced": (_interlaced, ("code", "spectral", "white", "black", "sentinel"), (0.3, 1.0)),
    "lamp on": (_lit, ("spectral",), (0.02, 0.05, 0.2)),
    "sentinels hidden": (_hidden, ("sentinel",), (0.05, 0.1)),
    "sentinels of one colour": (_one_colour, ("sentinel",), (0.03, 0.06, 0.1)),
}


def figures(name: str) -> dict[str, float]:
    """What is said of scans by a plan of `PLANS`, as numbers."""
    clean = _clean(name)
    said = {"clean": _of_report(clean), "clean, at once": _of_pictures(clean)}
    for kind, spoil in SINGLE.items():
        for what, roles in (("code", ("code", "white", "black")), ("lines", ("spectral", "sentinel"))):
            scan = clean.copy()
            shots = scan.of(*roles)
            # A picture between each two spoiled ones, so that no fault hides another.
            apart = max(len(shots) // len(DOSES), 2)
            for dose, shot in zip(DOSES, shots[len(shots) % 2 :: apart], strict=False):
                spoil(scan, shot, dose)
            said[f"{what} {kind}"] = _of_pictures(scan)
    for kind, (spoil, of_roles, doses) in LASTING.items():
        for dose in doses:
            scan = clean.copy()
            # The last first: what a picture shows of the one before is as that was.
            for shot in reversed(scan.of(*of_roles)):
                spoil(scan, shot, dose)
            said[f"{kind} {dose:g}"] = _of_report(scan)
    return {f"{of}: {what}": value for of, values in said.items() for what, value in values.items()}


def _of_report(scan: Scan) -> Figures:
    """What is said at the end of a scan."""
    seen = SeenFrames(scan.scene.plan)
    for shot, picture in scan.counts():
        seen.keep(shot, picture)
    report = seen.report(scan.scene.calibration)
    found = {"cannot tell": float(report.untold), **_of_findings(report.wrong)}
    for n, sentence in enumerate(report.light):
        found |= {
            f"sentence {n + 1}, number {k + 1}": float(each)
            for k, each in enumerate(NUMBER.findall(sentence))
        }
    return found


def _of_pictures(scan: Scan) -> Figures:
    """What is said of each picture when it is captured, none of them twice."""
    proof = FrameProof(scan.scene.plan, scan.scene.calibration)
    findings = [proof.judge(shot, picture) for shot, picture in scan.counts()]
    doubtful = float(sum(each.shot.index * each.is_doubtful for each in findings))
    return {"doubtful, places": doubtful, **_of_findings(findings)}


def _of_findings(findings: Sequence[Finding]) -> dict[str, float]:
    """How many pictures get each verdict, the sum of their places, and of the numbers that are told."""
    count: dict[str, float] = defaultdict(float)
    for each in findings:
        if each.is_wrong:
            count[each.verdict] += 1
            count[f"{each.verdict}, places"] += each.shot.index + sum(shot.index for shot in each.again)
            count[f"{each.verdict}, told"] += sum(map(float, NUMBER.findall(each.detail)))
    return count


def kept_file(name: str) -> Path:
    """Where figures of a plan are kept."""
    return Path(__file__).with_name(f"kept_{name}.json")


if __name__ == "__main__":
    for each in PLANS:
        keep(kept_file(each), figures(each))

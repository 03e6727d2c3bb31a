"""How well the model of a rig fits a scan: findings, and the verdict that they give in words."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Literal

from pydantic import ValidationError

from dsl_core.model.base import Record

#: Name of the attribute of a result that holds its `Fit` as JSON.
ATTRIBUTE = "fit"

Part = Literal[
    "profile",
    "response",
    "film",
    "orders",
    "light",
    "motion",
    "mixed pixels",
    "surfaces",
    "bands",
    "coverage",
    "exposure",
    "geometry",
    "lateral colour",
    "curves",
    "flat field",
    "focus",
    "noise",
]

#: From which relative deviation the level of the light is worth words.
TOLD_LEVEL = 0.005
#: How many deviations of its own a figure must be away from zero.
SIGMAS = 3.0

#: The parts as a sentence names them.
PARTS: dict[Part, str] = {
    "profile": "the profile of the lines",
    "response": "the response of camera or projector",
    "film": "the place of the film",
    "orders": "the light of the diffraction orders",
    "light": "the level of the light",
    "motion": "the scene, which should not move",
    "mixed pixels": "pixels that see several surfaces",
    "surfaces": "surfaces that are not matt, or finer than pixels",
    "bands": "the width of the bands",
    "coverage": "the part of the picture that was measured",
    "exposure": "the exposure",
    "geometry": "the geometry",
    "lateral colour": "the lateral colour of the lenses",
    "curves": "the curves of camera and projector",
    "flat field": "the flat field of the camera",
    "focus": "the focus of the camera",
    "noise": "the noise of the camera",
}


def matters(value: float, std: float, limit: float) -> bool:
    """Whether a figure is above its limit, and too far from zero for chance."""
    return bool(abs(value) > max(limit, SIGMAS * std))


class FitFinding(Record):
    """One figure of how the model fits a scan, and what it says about a part of the model.

    ``value`` has the standard deviation ``std`` (None where nobody knows it); above ``limit`` it matters.
    ``significant`` means that it matters and that chance does not explain it. ``sentence`` says what was
    found, ``advice`` what to do about it.
    """

    part: Part
    name: str
    value: float
    std: float | None = None
    unit: str
    limit: float
    significant: bool
    sentence: str
    advice: str = ""

    @classmethod
    def judged(
        cls,
        part: Part,
        name: str,
        found: float | tuple[float, float],
        unit: str,
        limit: float,
        sentence: str,
        advice: str,
    ) -> FitFinding:
        """A finding of a value, or a value and its deviation, that is significant where it `matters`."""
        value, std = found if isinstance(found, tuple) else (found, None)
        return cls(
            part=part,
            name=name,
            value=value,
            std=std,
            unit=unit,
            limit=limit,
            significant=matters(value, std or 0.0, limit),
            sentence=sentence,
            advice=advice,
        )

    @property
    def severity(self) -> float:
        """How far the value is beyond its limit: 1 at the limit."""
        return abs(self.value) / self.limit if self.limit else float("inf")


class Fit(Record):
    """What a result says about the fit of its model, from the worst finding to the best.

    ``model_error[band][row][column]`` is the part of the stated deviation of reflectance that is the model's,
    as a share of reflectance, in cells of the picture; empty where nothing is known. ``level_rel_std`` is the
    part, as a share of all reflectance, that the light may have changed by since its level was measured. The
    rest is noise, and what the calibration itself left open.
    ``common_rel_std`` is the part that all pixels have in common: what the calibration leaves open of white,
    and the scan of its light and of the pose.
    ``scale`` says what the scale of reflectance rests on and to what share it is known, and ``scale_rel_std``
    is its relative deviation, which is common to all pixels and only partly in the stated ones; None where
    there is no reflectance or nobody asked.
    ``measured`` says in what the calibration found the rig to be unlike the usual, which the result follows.
    ``unseen`` is what no finding can tell, in a sentence, such as the age of the calibration.
    """

    findings: tuple[FitFinding, ...] = ()
    model_error: tuple[tuple[tuple[float, ...], ...], ...] = ()
    level_rel_std: float = 0.0
    common_rel_std: float = 0.0
    scale_rel_std: float | None = None
    scale: str = ""
    measured: str = ""
    unseen: str = ""

    @classmethod
    def of(
        cls,
        findings: Iterable[FitFinding],
        model_error: tuple[tuple[tuple[float, ...], ...], ...] = (),
    ) -> Fit:
        """The findings in their order: significant ones first, and by severity among them."""
        ordered = sorted(findings, key=lambda f: (not f.significant, -f.severity))
        return cls(findings=tuple(ordered), model_error=model_error)

    @classmethod
    def read(cls, attributes: Mapping[str, object]) -> Fit | None:
        """The fit that a result's attributes hold; None where there is none, or none that can be read."""
        try:
            return cls.model_validate_json(str(attributes[ATTRIBUTE]))
        except (KeyError, ValidationError):
            return None

    @property
    def significant(self) -> tuple[FitFinding, ...]:
        """The findings that matter, the worst first."""
        return tuple(finding for finding in self.findings if finding.significant)

    @property
    def parts(self) -> tuple[Part, ...]:
        """The parts of the model that do not fit, the worst first, each once."""
        return tuple(dict.fromkeys(finding.part for finding in self.significant))

    @property
    def headline(self) -> str:
        """The verdict in one sentence.

        >>> Fit().headline
        'The model fits this rig and scene.'
        """
        if not self.parts:
            return "The model fits this rig and scene."
        names = [PARTS[part] for part in self.parts]
        listed = names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
        return f"The model does not fit this rig and scene in every respect. Look at {listed}."

    @property
    def words(self) -> str:
        """The verdict, what does not fit, each with what to do about it, and what no finding can tell."""
        lines = [self.headline, *(f"{f.sentence} {f.advice}".strip() for f in self.significant)]
        if self.significant and self.model_error:
            lines.append(f"Deviations of reflectance contain {self.model_share:.1%} of it for the model.")
        if self.measured:
            lines.append(self.measured)
        if self.level_rel_std >= TOLD_LEVEL:
            lines.append(
                f"Deviations of reflectance contain {self.level_rel_std:.1%} of it for what the light may"
                " have changed by since its level was measured."
            )
        lines += [text for text in (self.scale, self.unseen) if text]
        return "\n".join(lines)

    @property
    def model_share(self) -> float:
        """Root mean square of ``model_error``; 0 where nothing is known of it."""
        values = [value for band in self.model_error for row in band for value in row]
        return math.sqrt(sum(value * value for value in values) / len(values)) if values else 0.0

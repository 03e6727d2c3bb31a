"""What pictures say only together: whether light was lost, changed colour, or was wrong from the start."""

from __future__ import annotations

import numpy as np

from dsl_core.capture.proof.again.lit_again import LitAgain, lit_again
from dsl_core.capture.proof.again.single_pixels import SinglePixels, single_pixels
from dsl_core.capture.proof.code.code_colours import code_colours
from dsl_core.capture.proof.code.code_sum import CodeSum, code_sum
from dsl_core.capture.proof.code.first_light import flickers, light_of_pairs
from dsl_core.capture.proof.colour_again import ColourAgain, colour_again
from dsl_core.capture.proof.judging.known import Known
from dsl_core.capture.proof.lasting.coarse_values import coarse_values
from dsl_core.capture.proof.lasting.ends import sentences_of_ends
from dsl_core.capture.proof.lasting.light_noise import has_no_noise, is_stated, light_noise, noise_times
from dsl_core.capture.proof.lasting.pair_places import pair_places
from dsl_core.capture.proof.lasting.sharp_edges import sharp_edges
from dsl_core.capture.proof.lasting.soft_stripes import soft_stripes
from dsl_core.capture.proof.lines.calm_lines import CalmLines, calm_lines
from dsl_core.capture.proof.lines.line_sum import LineSum, line_sum
from dsl_core.capture.proof.lines.local_sum import LocalSum, local_sum
from dsl_core.capture.proof.white_again import WhiteAgain, white_again
from dsl_core.model.captured_code import CapturedCode
from dsl_core.model.plan import NoCode


class WholeScan:
    """Questions on all that is known of a scan; each has an answer as soon as its pictures are there."""

    def __init__(self, known: Known) -> None:
        """``known`` grows as pictures come."""
        self._known = known

    def code_sum(self) -> CodeSum | None:
        """What patterns and inverses of the first code are together; None while that says nothing."""
        known = self._known
        ends = [known.kept.get(known.places.get((role, 0), -1)) for role in ("white", "black")]
        if known.lit is None or ends[0] is None or ends[1] is None:
            return None
        return code_sum(known.code_pairs(), (ends[0], ends[1]), known.lit, known.noise)

    def line_sum(self) -> LineSum | None:
        """What all lines of the first setting are together; None while that says nothing."""
        known = self._known
        if known.lit is None:
            return None
        return line_sum(known.plan, known.first, known.kept, known.lit, known.noise)

    def local_sums(self) -> list[LocalSum]:
        """Where lines of each setting do not add up to white though most of the picture does."""
        known, lit = self._known, self._known.lit
        if lit is None:
            return []
        settings = range(len(known.plan.settings))
        found = (local_sum(known.plan, n, known.kept, lit, known.noise, known.raster) for n in settings)
        return [each for each in found if each is not None]

    def has_no_noise(self) -> bool:
        """Whether the first code shows pictures without any noise, as only computed ones are."""
        return has_no_noise(self._known.code_pairs(), self._known.noise, self._known.raster)

    def calm_lines(self) -> CalmLines | None:
        """Lines that have less noise than the calibration says, as only a camera's processing makes them."""
        known = self._known
        if known.calibration is None or not known.knows_light:
            return None
        times = noise_times(known.code_pairs(), known.noise, known.raster)
        if times is None or not is_stated(times):
            return None
        own = [s for s in known.shots if (s.role, s.setting) == ("spectral", known.first)]
        return calm_lines(own, known.kept, known.noise)

    def coarse_values(self) -> str:
        """That values come in steps larger than the camera's noise, as a sentence; empty if they do not."""
        known = self._known
        ends = known.ends(known.first)
        if known.calibration is None or ends is None:
            return ""
        pairs = known.code_pairs().values()
        return coarse_values((*ends, *(each for pair in pairs for each in pair)), known.noise.stated)

    def lit_again(self) -> LitAgain | None:
        """The first black, captured again, that is as bright as white somewhere, and was not at first."""
        known = self._known
        channels = known.raster.channels(known.bayer)
        return lit_again(known.plan, known.kept, channels, known.noise, known.raster)

    def single_pixels(self) -> SinglePixels | None:
        """The black, captured again, in which most pixels are far off alone."""
        known = self._known
        return single_pixels(known.plan, known.kept, known.noise, known.raster)

    def white_again(self) -> WhiteAgain | None:
        """The white, captured again, that differs most from the first in a part of the picture."""
        return white_again(self._known.plan, self._known.kept, self._known.noise, self._known.raster)

    def colour_again(self) -> ColourAgain | None:
        """The white, captured again, whose colour differs most from that of the first."""
        known = self._known
        return colour_again(known.plan, known.kept, known.noise, known.raster.channels(known.bayer))

    def lasting(self, with_colours: bool = True) -> list[str]:
        """Sentences on what was wrong from the first picture on, of the darkest setting that is there.

        Without ``with_colours``, those that a filter before the camera explains are left out.
        """
        known = self._known
        found = {s.setting for s in known.shots if s.role == "white"}
        levels = {n: known.plan.settings[n].level for n in sorted(found) if known.ends(n) is not None}
        setting = min(levels, key=lambda n: levels[n], default=None)
        ends = None if setting is None else known.ends(setting)
        said: list[str] = []
        if ends is not None and setting is not None:
            said = sentences_of_ends(
                *ends,
                known.plan,
                setting,
                known.calibration if known.knows_light else None,
                known.raster.channels(known.bayer),
                known.noise,
                known.raster,
                with_colours,
            )
        said = [self._sharp_edges(), *said, self._flicker(), self._code_colours(), self._pair_places()]
        said.append(self._light_noise())
        return [each for each in (*said, self._soft_stripes()) if each]

    def _sharp_edges(self) -> str:
        known = self._known
        ends = known.ends(known.first)
        if known.lit is None or ends is None:
            return ""
        return sharp_edges(known.code_pairs(), ends, known.noise, known.raster)

    def _flicker(self) -> str:
        known = self._known
        ends, whole = known.ends(known.first), self.code_sum()
        if known.lit is None or ends is None or whole is None:
            return ""
        lit = np.zeros(ends[0].shape, np.bool_)
        lit[known.lit.index] = True
        light = light_of_pairs(known.code_pairs(), ends, lit, known.noise)
        # Values that are not proportional to the light give pairs with more edges more of it.
        by_edges = 2 * abs(whole.curve)
        if not flickers(light) or max(light.values()) - min(light.values()) < by_edges:
            return ""
        return (
            f"The light flickers: pairs of the code have between {min(light.values()):.2f} and"
            f" {max(light.values()):.2f} times the light of white, up and down. Expose for whole periods of"
            " the mains and of the projector's LEDs, keep lamps of the room off, and scan again."
        )

    def _light_noise(self) -> str:
        known, whole = self._known, self.code_sum()
        # Values that are not proportional to the light have another slope, and noise, at each brightness.
        if known.calibration is None or not known.knows_light or (whole is not None and whole.is_curved):
            return ""
        found = light_noise(known.code_pairs(), known.noise, known.raster)
        return "" if found is None else found.sentence

    def _code_colours(self) -> str:
        known = self._known
        ends, whole = known.ends(known.first), self.code_sum()
        # Values that are not proportional to the light give edges of stripes other colours.
        if known.lit is None or ends is None or (whole is not None and whole.is_curved):
            return ""
        channels = known.raster.channels(known.bayer)
        found = code_colours(known.code_pairs(), ends, known.noise, channels)
        return "" if found is None else found.sentence

    def _pair_places(self) -> str:
        known, code = self._known, self._known.plan.code
        if known.lit is None or isinstance(code, NoCode | CapturedCode):
            return ""
        found = pair_places(code, known.plan.projector_size_px, known.code_pairs(), known.lit)
        return "" if found is None else found.sentence

    def _soft_stripes(self) -> str:
        known, code = self._known, self._known.plan.code
        ends = known.ends(known.first)
        if known.calibration is None or ends is None or isinstance(code, NoCode | CapturedCode):
            return ""
        found = soft_stripes(code, known.code_pairs(), ends, known.calibration, known.noise, known.raster)
        return "" if found is None else found.sentence

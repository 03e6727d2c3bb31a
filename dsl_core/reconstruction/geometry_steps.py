"""From frames to depth, points and normals of a whole picture, in three steps that can be timed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from dsl_core.model.fit import FitFinding
from dsl_core.model.options import Options
from dsl_core.model.rig import ProjectorResponse, Rig
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.sensor import bayer_channels
from dsl_core.optics.spread.fit import SpreadFit
from dsl_core.patterns.gray_code import DecodedCode
from dsl_core.progress import Progress
from dsl_core.reconstruction.camera_spot import follow_spot, spot_finding
from dsl_core.reconstruction.code_agreement import NamedPlaces, code_agreement
from dsl_core.reconstruction.code_wave import code_wave, with_varying_width
from dsl_core.reconstruction.columns.colour_widths import ColourWidths, colour_widths, pixel_colours
from dsl_core.reconstruction.columns.line_peaks import LinePeaks, comb_peaks, smooth_peaks
from dsl_core.reconstruction.columns.line_spread import own_spread, spread_pixels, with_own_spread
from dsl_core.reconstruction.columns.peak_error import peak_error
from dsl_core.reconstruction.columns.spread_doubt import SpreadDoubt, spread_doubt
from dsl_core.reconstruction.findings.spread_findings import spread_findings
from dsl_core.reconstruction.fine_texture import follow_scatter
from dsl_core.reconstruction.geometry import (
    FoundColumns,
    Geometry,
    geometry_of,
    require_light,
    require_pixels,
)
from dsl_core.reconstruction.hdr import MergedFrame
from dsl_core.reconstruction.lenses import follow_lenses
from dsl_core.reconstruction.light.followed import follow_light
from dsl_core.reconstruction.light.told import unsure_level
from dsl_core.reconstruction.rows.columns import columns_by_rows
from dsl_core.reconstruction.rows.frames import ScanFrames
from dsl_core.reconstruction.spectral.highlights import follow_highlights


@dataclass(frozen=True)
class _Spread:
    """What is known of the spread of lines: what was found, what of it is in doubt, and errors that follow.

    ``error`` is that of the modelled peak, relative to it, None for the usual one; ``wave_px`` that of
    columns between edges of the code.
    """

    found: SpreadFit | None = None
    doubt: SpreadDoubt | None = None
    error: float | None = None
    wave_px: float = 0.0


def _error_of(peaks: LinePeaks | None) -> float | None:
    """The error that peaks ask for; None, the usual one, where there are none to ask."""
    return None if peaks is None else peak_error(peaks)


class GeometrySteps:
    """`decode`, `read_lines` and `measure`, in this order.

    Unless all is ``as_calibrated``, light, line spread and lenses are followed: ``rig`` becomes the rig as
    this scan has it, and ``findings`` say in what it differs from its calibration.
    """

    def __init__(self, rig: Rig, options: Options, frames: ScanFrames, progress: Progress) -> None:
        """The frames are followed, too: later steps see them as in steady light."""
        self.rig = rig
        self.findings: list[FitFinding] = []
        self._lines = LineSet.of(frames.plan)
        self._options, self._frames, self._progress = options, frames, progress
        # Of large pictures these take much of the memory: they are kept no longer than they are needed.
        self._decoded: tuple[DecodedCode, MergedFrame] | None = None

    def decode(self) -> None:
        """Read what the binary code says of every pixel; raises `DslError` if nothing is lit."""
        self._decoded = self._frames.decode(self._progress)
        white = self._decoded[1]
        require_light(white.radiance, white.saturated)

    def read_lines(self) -> None:
        """Look at the line frames once, and follow the light through all frames."""
        if self._options.as_calibrated:
            self._frames.look(progress=self._progress)
            return
        code, white, found = follow_light(
            self._frames, *self._taken(), partial(spread_pixels, self._lines), self._progress
        )
        self._decoded = code, white
        self.findings += found
        level = unsure_level(self._frames.plan, self.rig.projector_response, found)
        unsure = float(np.hypot(self.rig.white_scale_rel_std, level))
        self.rig = self.rig.model_copy(update={"white_scale_rel_std": unsure})

    def measure(self) -> Geometry:
        """Columns, depth and surface; raises `DslError` if no pixel has a depth."""
        options, calibrated = self._options, self.rig.projector_response
        follows = options.refine_columns and not options.as_calibrated
        code, white = self._taken()
        known = self._own_spread(code, white) if follows else _Spread()
        columns = self._columns(code, white, known)
        named = NamedPlaces.of(code)
        if follows:
            columns, known = self._own_width(columns, known, code, white, named)
        del code, white
        geometry = geometry_of(
            self.rig,
            self._lines if options.refine_columns else None,
            columns,
            self._frames.shape,
            options.surface_window_px,
            None if known.doubt is None or known.doubt.is_sure else known.doubt,
            code_wave_px=known.wave_px,
        )
        del columns
        require_pixels(geometry.flags)
        return self._followed(geometry, named, calibrated, known.found) if follows else geometry

    def _own_spread(self, code: DecodedCode, white: MergedFrame) -> _Spread:
        """What this scan's lines say of their spread, which ``rig`` then has."""
        found = own_spread(self.rig, self._lines, code, white, self._frames)
        self.rig = with_own_spread(self.rig, found)
        peaks = smooth_peaks(self.rig, self._lines, code, white, self._frames)
        widths = None if peaks is None else self._colour_widths(peaks, code, white)
        if widths is not None and widths.differ:
            self.findings.append(widths.finding())
            self.rig = widths.of(self.rig)
            peaks = smooth_peaks(self.rig, self._lines, code, white, self._frames)
        asked = comb_peaks(self.rig, self._lines, code, white, self._frames) if peaks is None else peaks
        return _Spread(found, spread_doubt(peaks, found), _error_of(asked))

    def _colour_widths(self, peaks: LinePeaks, code: DecodedCode, white: MergedFrame) -> ColourWidths | None:
        """The widths of lines in each colour; None without colours, or where lines do not tell."""
        if self.rig.sensor.bayer == "MONO":
            return None
        pixels = spread_pixels(self._lines, code, white)
        return colour_widths(peaks, pixel_colours(self.rig, pixels))

    def _own_width(
        self,
        columns: FoundColumns,
        known: _Spread,
        code: DecodedCode,
        white: MergedFrame,
        named: NamedPlaces,
    ) -> tuple[FoundColumns, _Spread]:
        """The same columns, or others where the edges of the code say that lines are wider or narrower."""
        lines, doubt, error = self._lines, known.doubt, known.error
        wave = code_wave(lines, named.column, columns.maps)
        if wave is not None and doubt is not None:
            # One width may be well known, and yet be that of no part of a picture whose focus varies.
            own = wave.own_width(doubt)
            doubt = own.known(doubt)
            if own.changed:
                self.findings.append(own.finding())
                self.rig = own.of(self.rig)
                error = _error_of(smooth_peaks(self.rig, lines, code, white, self._frames))
                columns = self._columns(code, white, replace(known, error=error))
                wave = code_wave(lines, named.column, columns.maps)
            colours = bayer_channels(self.rig.sensor.bayer, *named.column.shape)
            doubt = with_varying_width(doubt, lines, named.column, columns.maps, colours)
        if wave is not None:
            self.findings.append(wave.finding())
        wave_px = 0.0 if wave is None else wave.error_px
        return columns, replace(known, doubt=doubt, error=error, wave_px=wave_px)

    def _columns(self, code: DecodedCode, white: MergedFrame, known: _Spread) -> FoundColumns:
        return columns_by_rows(
            self.rig, self._options, self._frames, code, white, known.error, self._progress
        )

    def _followed(
        self, geometry: Geometry, named: NamedPlaces, calibrated: ProjectorResponse, found: SpreadFit | None
    ) -> Geometry:
        """The same with what depth, code and lines say together of lenses, pixels, scatter and highlights."""
        window_px = self._options.surface_window_px
        self.rig, geometry, more = follow_lenses(self.rig, self._lines, geometry, window_px)
        self.findings += more
        geometry, spot = follow_spot(self.rig, self._lines, geometry, window_px)
        if spot is not None:
            self.findings.append(spot_finding(spot))
        geometry, more = follow_scatter(self.rig, geometry, window_px)
        self.findings += more
        if found is not None:
            self.findings += spread_findings(calibrated, found, 0.0 if spot is None else spot.columns_px)
        plan, blur_px = self._frames.plan, calibrated.blur_px
        geometry, more = code_agreement(self.rig, plan, named, geometry, window_px, blur_px)
        self.findings += more
        if self._options.spectra:
            geometry, more = follow_highlights(self.rig, geometry)
            self.findings += more
        return geometry

    def _taken(self) -> tuple[DecodedCode, MergedFrame]:
        decoded, self._decoded = self._decoded, None
        assert decoded is not None, "decode() comes first"
        return decoded

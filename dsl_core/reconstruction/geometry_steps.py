"""From frames to depth, points and normals of a whole picture, in three steps that can be timed."""

from __future__ import annotations

from functools import partial

import numpy as np

from dsl_core.model.fit import FitFinding
from dsl_core.model.options import Options
from dsl_core.model.rig import Rig
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.patterns.gray_code import DecodedCode
from dsl_core.progress import Progress
from dsl_core.reconstruction.camera_spot import follow_spot, spot_finding
from dsl_core.reconstruction.code_agreement import NamedPlaces, code_agreement
from dsl_core.reconstruction.code_wave import code_wave, with_varying_width
from dsl_core.reconstruction.columns.column import MODEL_ERROR
from dsl_core.reconstruction.columns.line_peaks import smooth_peaks
from dsl_core.reconstruction.columns.line_spread import own_spread, spread_pixels, with_own_spread
from dsl_core.reconstruction.columns.peak_error import peak_error
from dsl_core.reconstruction.columns.spread_doubt import spread_doubt
from dsl_core.reconstruction.findings.spread_findings import spread_findings
from dsl_core.reconstruction.fine_texture import follow_scatter
from dsl_core.reconstruction.geometry import Geometry, geometry_of, require_light, require_pixels
from dsl_core.reconstruction.hdr import MergedFrame
from dsl_core.reconstruction.lenses import follow_lenses
from dsl_core.reconstruction.light.followed import follow_light, unsure_level
from dsl_core.reconstruction.rows.columns import columns_by_rows
from dsl_core.reconstruction.rows.frames import ScanFrames
from dsl_core.reconstruction.spectral.highlights import follow_highlights


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
        options, frames, lines = self._options, self._frames, self._lines
        code, white = self._taken()
        refines_rig = options.refine_columns and not options.as_calibrated
        error, calibrated, spread, doubt = MODEL_ERROR, self.rig.projector_response, None, None
        if refines_rig:
            spread = own_spread(self.rig, lines, code, white, frames)
            self.rig = with_own_spread(self.rig, spread)
            peaks = smooth_peaks(self.rig, lines, code, white, frames)
            error, doubt = peak_error(peaks), spread_doubt(peaks, spread)
            del peaks
        columns = columns_by_rows(self.rig, options, frames, code, white, error, self._progress)
        named = NamedPlaces.of(code)
        wave = code_wave(lines, named.column, columns.maps) if refines_rig else None
        if wave is not None and doubt is not None:
            # One width may be well known, and yet be that of no part of a picture whose focus varies.
            own = wave.own_width(doubt)
            doubt = own.known(doubt)
            if own.changed:
                self.findings.append(own.finding())
                self.rig = own.of(self.rig)
                error = peak_error(smooth_peaks(self.rig, lines, code, white, frames))
                columns = columns_by_rows(self.rig, options, frames, code, white, error, self._progress)
                wave = code_wave(lines, named.column, columns.maps)
            doubt = with_varying_width(doubt, lines, named.column, columns.maps)
        del code, white
        if wave is not None:
            self.findings.append(wave.finding())
        geometry = geometry_of(
            self.rig,
            lines if options.refine_columns else None,
            columns,
            frames.shape,
            options.surface_window_px,
            None if doubt is None or doubt.is_sure else doubt,
            code_wave_px=0.0 if wave is None else wave.error_px,
        )
        del columns
        require_pixels(geometry.flags)
        if not refines_rig:
            return geometry
        window_px = options.surface_window_px
        self.rig, geometry, found = follow_lenses(self.rig, lines, geometry, window_px)
        self.findings += found
        geometry, spot = follow_spot(self.rig, lines, geometry, window_px)
        if spot is not None:
            self.findings.append(spot_finding(spot))
        geometry, found = follow_scatter(self.rig, geometry, window_px)
        self.findings += found
        if spread is not None:
            self.findings += spread_findings(calibrated, spread, 0.0 if spot is None else spot.columns_px)
        blur_px = calibrated.blur_px
        geometry, found = code_agreement(self.rig, frames.plan, named, geometry, window_px, blur_px)
        self.findings += found
        if options.spectra:
            geometry, found = follow_highlights(self.rig, geometry)
            self.findings += found
        return geometry

    def _taken(self) -> tuple[DecodedCode, MergedFrame]:
        decoded, self._decoded = self._decoded, None
        assert decoded is not None, "decode() comes first"
        return decoded

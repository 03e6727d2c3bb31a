"""A result that is made of bands of rows."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.fit import FitFinding
from dsl_core.model.options import Options
from dsl_core.model.plan import CapturePlan
from dsl_core.model.result import Flag
from dsl_core.model.result_sink import ResultSink
from dsl_core.model.rig import Rig
from dsl_core.reconstruction.findings.fit import fit_of
from dsl_core.reconstruction.findings.flag_findings import SpectralCounts, count_spectra
from dsl_core.reconstruction.findings.known_causes import with_known_causes
from dsl_core.reconstruction.geometry import Geometry
from dsl_core.reconstruction.rows.bands import Band
from dsl_core.reconstruction.scan_result import attributes_of, maps_of_rows
from dsl_core.reconstruction.spectral.rig_traits import traits_in_words
from dsl_core.reconstruction.spectral.solvers import RowSolver
from dsl_core.reconstruction.spectral.spectral_maps import SpectralMaps

if TYPE_CHECKING:
    import xarray as xr


class Assembly:
    """Puts what is known of a picture into a sink, band by band; of the part alone that is wanted.

    ``counts`` are those of the spectra so far, ``poor`` (rows, columns) where none explains the frames.
    """

    def __init__(
        self,
        rig: Rig,
        plan: CapturePlan,
        options: Options,
        geometry: Geometry,
        bands: Sequence[Band],
        sink: ResultSink,
    ) -> None:
        self._rig, self._plan, self._options = rig, plan, options
        self._geometry, self._sink = geometry, sink
        self.counts = SpectralCounts()
        self._rows, self._columns = (
            slice(*wanted.indices(size)[:2])
            for wanted, size in zip(options.part, geometry.flags.shape, strict=True)
        )
        shape = self._rows.stop - self._rows.start, self._columns.stop - self._columns.start
        # Whether no spectrum explains whole areas is seen in the whole picture.
        self.poor = np.zeros(shape, bool)
        places = [place for band in bands if (place := self._place(band)).start < place.stop]
        sink.begin(shape, (self._rows.start, self._columns.start), options.grid.centres_nm, places)

    def missing(self, bands: Iterable[Band]) -> Iterator[Band]:
        """Bands that are wanted and not in the sink yet."""
        for band in bands:
            place = self._place(band)
            if place.start >= place.stop:
                continue
            note = self._sink.note_of(place)
            kept = None if note is None else json.loads(note)
            if kept is None or set(kept) != {"counts", "poor"}:
                yield band
            else:
                self.poor[place] = _unpacked(kept["poor"], self.poor[place].shape)
                self.counts += SpectralCounts(**kept["counts"])

    def put(self, band: Band, spectra: SpectralMaps | None) -> None:
        """Put the rows of a band into the sink, with spectra if there are any."""
        maps = maps_of_rows(self._rig, self._options.grid, self._geometry, band.rows, spectra)
        place, top = self._place(band), self._rows.start - band.rows.start
        own = slice(place.start + top, place.stop + top)
        wanted = {name: values[..., own, self._columns] for name, values in maps.items()}
        counts = SpectralCounts()
        if spectra is not None:
            inside = (..., own, self._columns)
            flags: NDArray[np.uint16] = np.asarray(wanted["flags"], np.uint16)
            counts = count_spectra(
                flags,
                spectra.data_share[inside],
                spectra.reach[inside],
                spectra.reflectance[inside],
                spectra.std[inside],
            )
            self.poor[place] = (flags & int(Flag.POOR_FIT)) != 0
        self.counts += counts
        note = {"counts": asdict(counts), "poor": packed(self.poor[place])}
        self._sink.put(place, wanted, json.dumps(note))

    def finish(
        self,
        solver: RowSolver | None,
        findings: Iterable[FitFinding],
        black_dn_per_ms: Sequence[float] = (),
    ) -> xr.Dataset:
        """The whole result, with the verdict on it.

        ``findings`` are those that were made on the way; ``black_dn_per_ms`` is what `mean_black` found.
        """
        geometry = self._geometry
        fit = fit_of(
            self._rig,
            self._plan,
            self._options.grid,
            geometry.depth_mm,
            geometry.flags[self._rows, self._columns] | self.poor * np.uint16(int(Flag.POOR_FIT)),
            None if solver is None else self.counts,
            # Columns of the code alone are off by more than what is looked for in lines.
            solver.followed if solver is not None and self._options.refine_columns else None,
            None if solver is None else solver.error,
            with_known_causes([*findings, *(() if solver is None else solver.findings)]),
        )
        fit = fit.model_copy(update={"measured": traits_in_words(self._rig)})
        return self._sink.finish(attributes_of(self._rig, self._plan, fit, black_dn_per_ms))

    def _place(self, band: Band) -> slice:
        """Rows of a band in the result."""
        top, bottom = self._rows.start, self._rows.stop
        return slice(max(band.rows.start, top) - top, min(band.rows.stop, bottom) - top)


def packed(mask: NDArray[np.bool_]) -> str:
    """A mask as a little text."""
    return base64.b64encode(np.packbits(mask).tobytes()).decode("ascii")


def _unpacked(text: str, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    bits = np.frombuffer(base64.b64decode(text), np.uint8)
    return np.unpackbits(bits, count=int(np.prod(shape))).astype(bool).reshape(shape)

"""Where bands of a picture are put into a result of a part of it, and which of them are still missing."""

from __future__ import annotations

import json
from dataclasses import asdict
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dsl_core.model.fit import Fit
from dsl_core.model.options import Options
from dsl_core.model.plan import CapturePlan
from dsl_core.reconstruction.findings.flag_findings import SpectralCounts
from dsl_core.reconstruction.rows import assembly as module
from dsl_core.reconstruction.rows.assembly import Assembly
from dsl_core.reconstruction.rows.bands import Band
from dsl_core.simulation.published_rig import published_rig

BANDS = [Band(slice(top, top + 4), slice(max(top - 4, 0), top + 8)) for top in (0, 4, 8, 12)]


class Sink:
    """What was put where."""

    def __init__(self) -> None:
        self.begun: tuple[Any, ...] = ()
        self.put_into: list[tuple[slice, dict[str, Any]]] = []
        self.notes: dict[tuple[int, int], str] = {}

    def begin(self, *given: Any) -> None:
        self.begun = given

    def note_of(self, place: slice) -> str | None:
        return self.notes.get((place.start, place.stop))

    def put(self, place: slice, maps: dict[str, Any], note: str) -> None:
        self.put_into.append((place, maps))
        self.notes[place.start, place.stop] = note

    def finish(self, attributes: dict[str, Any]) -> Any:
        return attributes


def made(region_px: tuple[int, int, int, int] | None) -> tuple[Assembly, Sink]:
    sink: Any = Sink()
    geometry: Any = SimpleNamespace(flags=np.zeros((16, 10), np.uint16))
    options = Options(region_px=region_px)
    return Assembly(published_rig(), CapturePlan(), options, geometry, BANDS, sink), sink


def test_a_part_of_a_picture_begins_with_the_bands_that_reach_into_it() -> None:
    _, sink = made((2, 6, 7, 8))
    shape, corner, nm, places = sink.begun
    assert (shape, corner) == ((8, 7), (6, 2))
    assert nm.tolist() == Options().grid.centres_nm.tolist()
    assert [(place.start, place.stop) for place in places] == [(0, 2), (2, 6), (6, 8)]
    _, sink = made(None)
    assert [(place.start, place.stop) for place in sink.begun[3]] == [(0, 4), (4, 8), (8, 12), (12, 16)]


def test_missing_are_bands_of_the_part_that_have_no_note() -> None:
    assembly, sink = made((0, 6, 10, 6))
    assert [band.rows.start for band in assembly.missing(BANDS)] == [4, 8]
    poor = np.arange(20).reshape(2, 10) % 3 == 0
    kept = SpectralCounts(poor=7)
    sink.notes[0, 2] = json.dumps({"counts": asdict(kept), "poor": module.packed(poor)})
    assert [band.rows.start for band in assembly.missing(BANDS)] == [8]
    # What the verdict needs of kept rows is known again.
    assert assembly.counts == kept
    assert assembly.poor[:2].tolist() == poor.tolist()
    assert not assembly.poor[2:].any()


def test_rows_kept_by_another_version_are_made_again() -> None:
    assembly, sink = made((0, 6, 10, 6))
    sink.notes[0, 2] = json.dumps(asdict(SpectralCounts()))
    assert [band.rows.start for band in assembly.missing(BANDS)] == [4, 8]


@pytest.mark.parametrize(("top", "rows", "place"), [(4, [6, 7], (0, 2)), (8, [8, 9, 10, 11], (2, 6))])
def test_of_a_band_the_rows_and_columns_of_the_part_are_put(
    top: int, rows: list[int], place: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    numbers = np.arange(160).reshape(16, 10)

    def maps_of_rows(rig: Any, grid: Any, geometry: Any, own: slice, spectra: Any) -> dict[str, Any]:
        return {"map": numbers[own], "cube": numbers[None, own]}

    monkeypatch.setattr(module, "maps_of_rows", maps_of_rows)
    assembly, sink = made((2, 6, 7, 7))
    assembly.put(BANDS[top // 4], None)
    ((where, maps),) = sink.put_into
    assert (where.start, where.stop) == place
    assert maps["map"].tolist() == numbers[rows, 2:9].tolist()
    assert maps["cube"].tolist() == [numbers[rows, 2:9].tolist()]
    assert SpectralCounts(**json.loads(sink.notes[place])["counts"]) == SpectralCounts()


def test_the_verdict_says_what_the_calibration_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    assembly, _ = made(None)
    monkeypatch.setattr(module, "fit_of", lambda *given: Fit())
    monkeypatch.setattr(module, "traits_in_words", lambda rig: f"{rig.name} is bent.")
    assembly._geometry.depth_mm = np.zeros((16, 10))  # type: ignore[misc]
    attributes: Any = assembly.finish(None, ())
    found = Fit.read(attributes)
    assert found is not None
    assert found.measured == f"{published_rig().name} is bent."

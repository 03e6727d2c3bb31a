"""A sharp projector leaves pixels between edges of lines that meet; lines that overlap have other reasons."""

from __future__ import annotations

import numpy as np

from dsl_core.model.fit import Fit
from dsl_core.model.plan import CapturePlan, ScanLines
from dsl_core.model.result import Flag
from dsl_core.reconstruction.findings.line_edges import edge_findings

EDGE_TO_EDGE = CapturePlan(spectral=ScanLines(step_px=5))


def flags(every: int) -> np.ndarray[tuple[int, ...], np.dtype[np.uint16]]:
    """Every so many columns of the picture, the binary code alone tells the column."""
    made = np.zeros((20, 30), np.uint16)
    made[:, ::every] = int(Flag.NOT_REFINED)
    return made


def test_lines_that_meet_are_told_to_overlap_where_much_lies_between_their_edges() -> None:
    told = Fit.of(edge_findings(EDGE_TO_EDGE, flags(3), 0.3))
    assert told.parts == ("profile",)
    assert "33%" in told.words
    assert "overlap" in told.words
    assert Fit.of(edge_findings(EDGE_TO_EDGE, flags(10), 0.3)).parts == ()


def test_lines_that_overlap_or_have_soft_edges_are_told_nothing() -> None:
    assert list(edge_findings(CapturePlan(), flags(3), 0.3)) == []
    # Narrow filters before a usual projector: few pixels have light enough to be refined.
    assert list(edge_findings(EDGE_TO_EDGE, flags(3), 0.6)) == []

"""What became of a batch, as a table, as sentences and as a page."""

from __future__ import annotations

import math
from pathlib import Path

from dsl_core.evaluation.report.pages import render_page
from dsl_core.evaluation.report.series_page import Table
from dsl_core.io.objects.address import shown
from dsl_core.workflows.batch.batch import BatchReport
from dsl_core.workflows.batch.task import Outcome

_TITLE = "Batch of scans"
_WORDS = {"made": "reconstructed", "kept": "complete before", "failed": "failed", "claimed": "in work"}
#: Where the title of a page is, bytes.
_HEAD_BYTES = 4096


def batch_table(report: BatchReport) -> Table:
    """A row for each scan, in their order."""
    heads = ("Scan", "State", "Depth, % of pixels", "CPU, s", "Time, s", "Memory, MB", "Verdict")
    return Table(heads, tuple(_row(each) for each in report.outcomes))


def _row(outcome: Outcome) -> tuple[str, ...]:
    share = outcome.pixels_with_depth
    costs = (f"{outcome.cpu_s:.1f}", f"{outcome.seconds:.1f}", f"{outcome.peak_bytes / 1e6:.0f}")
    return (
        shown(outcome.scan),
        _WORDS[outcome.state],
        "" if math.isnan(share) else f"{100 * share:.1f}",
        *(costs if outcome.state == "made" else ("", "", "")),
        outcome.verdict,
    )


def batch_sentences(report: BatchReport) -> list[str]:
    """What failed and why, and what is to be said of results that are there."""
    told = [f"{shown(each.scan)}: {each.sentence}" for each in report.outcomes if each.sentence]
    return told + [f"{shown(each.scan)}: {remark}" for each in report.outcomes for remark in each.remarks]


def batch_page(report: BatchReport) -> str:
    """The report as one page; raises `StoreError` when its template is not installed."""
    note = " ".join([report.words, *batch_sentences(report)])
    table = batch_table(report)
    return render_page(
        "series.html.j2", title=_TITLE, note=note, verdicts=(), plots=(), table=table, pictures=()
    )


def is_batch_page(path: Path) -> bool:
    """Whether a file is such a page."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return f"<title>{_TITLE}</title>".encode() in file.read(_HEAD_BYTES)

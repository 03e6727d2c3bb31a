"""Whatever changes what a reconstruction finds is seen, in figures of scans that most corrections act on."""

from __future__ import annotations

import pytest

from tests.cases.kept_figures import changes, read_kept
from tests.reconstruction.kept_figures import SCANS, figures, kept_file, slack


@pytest.mark.slow
@pytest.mark.parametrize("scan", SCANS)
def test_a_reconstruction_finds_what_it_found(scan: str) -> None:
    before = read_kept(kept_file(scan))
    changed = changes(before, figures(scan), lambda name: slack(name, before))
    assert not changed, "If that was meant: python -m tests.reconstruction.kept_figures"

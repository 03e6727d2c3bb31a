"""Whatever changes from which dose on the proof notices a fault is seen."""

from __future__ import annotations

import pytest

from tests.capture.kept_figures import PLANS, figures, kept_file
from tests.cases.kept_figures import changes, read_kept


@pytest.mark.slow
@pytest.mark.parametrize("plan", PLANS)
def test_faults_are_noticed_from_the_dose_on_that_they_were(plan: str) -> None:
    changed = changes(read_kept(kept_file(plan)), figures(plan))
    assert not changed, "If that was meant: python -m tests.capture.kept_figures"

"""Whatever changes what calibrations find is seen, in the figures of a rig that all of them made."""

from __future__ import annotations

from tests.campaign.conftest import Calibrated
from tests.campaign.kept_figures import KEPT, figures, slack
from tests.cases.kept_figures import changes, read_kept


def test_calibrations_find_what_they_found(calibrated: Calibrated) -> None:
    before = read_kept(KEPT)
    changed = changes(before, figures(calibrated.folder / "rig.json"), lambda name: slack(name, before))
    assert not changed, "If that was meant: python -m tests.campaign.kept_figures"

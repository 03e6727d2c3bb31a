"""Whatever goes wrong in a calibration is told by its step or picture, and leaves all else as it was."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.cases.bad_calibration_inputs import CASES, BadInput, run_case
from tests.cases.tiny_campaign import contents

from .conftest import Calibrated

#: The campaign takes most of it.
pytestmark = pytest.mark.timeout(600)


@pytest.mark.slow
@pytest.mark.parametrize("case", [case for case in CASES if case.quick], ids=lambda case: case.name)
def test_it_is_told_and_leaves_the_rest(
    case: BadInput, calibrated: Calibrated, untouched: dict[str, bytes], tmp_path: Path
) -> None:
    told = run_case(case, calibrated.folder, tmp_path / "campaign")
    assert told.code == case.code, told.message
    assert re.search(case.told, told.message), told.message
    assert told.changed == ()
    assert contents(calibrated.folder) == untouched

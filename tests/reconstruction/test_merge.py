from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.errors import DecodeError
from dsl_core.model.plan import CapturePlan, Shot
from dsl_core.reconstruction.merge import check_source
from tests.cases.small_rig import small_rig


class Source:
    """A scan of which only the plan is asked for."""

    def __init__(self, **sizes: tuple[int, int]) -> None:
        self.plan = CapturePlan().model_copy(update=sizes)

    def read(self, shot: Shot) -> NDArray[np.uint16]:
        raise NotImplementedError


def test_a_calibration_for_another_size_is_refused_with_both_sizes() -> None:
    rig, source = small_rig(), Source()
    assert check_source(source, rig) is source.plan
    with pytest.raises(DecodeError, match=r"camera of 445 x 290 pixels.* 'small' is for 890 x 580"):
        check_source(Source(camera_size_px=(445, 290)), rig)
    with pytest.raises(DecodeError, match=r"projector of 1024 x 768 pixels.* is for 640 x 360"):
        check_source(Source(projector_size_px=(1024, 768)), rig)

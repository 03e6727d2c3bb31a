"""Lines that a plan shows at several settings are rendered once, as far as there is room."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.model.spectral import SpectralCurve
from dsl_core.simulation.rendering import renderer as module
from dsl_core.simulation.rendering.kept_lines import KeptLines
from tests.simulation.rendering.test_renderer import bands_of_columns, renderer, small_rig


def test_a_line_at_another_level_is_not_rendered_again(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = small_rig(black_fraction=0.01)
    chart, response = renderer(rig), rig.projector_response
    bright = chart.expected(bands_of_columns((300, 305)))
    dark = chart.expected(bands_of_columns())
    wanted = renderer(rig).expected(bands_of_columns((300, 305), level=90))

    def rendered(*_: object) -> None:
        raise AssertionError("it was rendered again")

    with monkeypatch.context() as patch:
        patch.setattr(module, "add_bands", rendered)
        faint = chart.expected(bands_of_columns((300, 305), level=90))
        with pytest.raises(AssertionError, match="rendered again"):
            chart.expected(bands_of_columns((310, 315), level=90))
    assert np.array_equal(faint, wanted)
    share = (response.radiance(90 / 255) - 0.01) / (response.radiance(1.0) - 0.01)
    assert faint - dark == pytest.approx(share * (bright - dark), abs=1e-6 * float(bright.max()))


def test_a_filter_and_colours_have_lines_of_their_own() -> None:
    chart, line = renderer(small_rig()), bands_of_columns((300, 305))
    bare = chart.expected(line)
    filtered = chart.through(SpectralCurve.of([400.0, 550.0, 700.0], [0.2, 0.5, 0.2]))
    assert filtered.expected(line).max() < 0.6 * bare.max()
    assert np.array_equal(chart.expected(line), bare)


def test_no_more_is_kept_than_there_is_room_for() -> None:
    kept, rendered = KeptLines(most_bytes=100), list[int]()

    def picture(number: int) -> np.ndarray:
        rendered.append(number)
        return np.full(10, number, np.float32)

    for number in (1, 2, 3, 1, 2, 3):
        found = kept.of((number, number + 5.0), lambda: picture(number))  # noqa: B023
        assert found[0] == number
    assert rendered == [1, 2, 3, 3]

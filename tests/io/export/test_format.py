"""What a format can do unless it says otherwise."""

from __future__ import annotations

from pathlib import Path

from dsl_core.io.export import formats
from dsl_core.io.export.format import Format


def test_a_format_needs_nothing_and_is_listed_unless_it_says_so() -> None:
    plain = Format("x", ".x", "X", lambda result, path, **options: [Path(path)])
    assert (plain.needs_spectra, plain.needs_pins, plain.listed) == (False, False, True)


def test_cubes_need_spectra_and_tables_pins() -> None:
    known = formats()
    assert {key for key, each in known.items() if each.needs_spectra} == {"envi", "exr", "csv"}
    assert {key for key, each in known.items() if each.needs_pins} == {"csv"}
    assert not known["mesh"].listed
    assert known["ply"].listed

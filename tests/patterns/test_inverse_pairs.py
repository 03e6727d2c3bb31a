"""Pairs of a pattern and its inverse, by the numbers of their frames."""

from __future__ import annotations

from dsl_core.model.captured_code import CapturedCode, Phases, Stripes
from dsl_core.model.plan import EnsembleCode, GrayCode, NoCode, XorCode
from dsl_core.patterns.inverse_pairs import inverse_pairs, lone_stripes


def test_own_codes_have_a_set_of_columns_and_one_of_rows() -> None:
    columns = ((0, 1), (2, 3), (4, 5))
    assert inverse_pairs(GrayCode(rows=False), (8, 4)) == (columns,)
    assert inverse_pairs(XorCode(), (8, 4)) == (columns, ((6, 7), (8, 9)))
    assert inverse_pairs(EnsembleCode(rows=False), (8, 4)) == (columns,)
    assert inverse_pairs(NoCode(), (8, 4)) == ()


def test_of_other_codes_only_what_was_captured_twice() -> None:
    code = CapturedCode(
        column_sets=(Stripes(bits=3, lacking=(3,)), Phases(periods_px=(8.0,), steps=3)),
        row_sets=(Stripes(bits=2),),
    )
    assert inverse_pairs(code, (8, 4)) == (((0, 1), (3, 4)), ((8, 9), (10, 11)))
    alone = CapturedCode(column_sets=(Stripes(bits=3, inverse=False),))
    assert inverse_pairs(alone, (8, 4)) == ()


def test_patterns_without_inverse_are_named_in_their_order() -> None:
    code = CapturedCode(
        column_sets=(Stripes(bits=3, lacking=(3,)), Phases(periods_px=(8.0,), steps=3)),
        row_sets=(Stripes(bits=2, inverse=False),),
    )
    assert lone_stripes(code) == ((2,), (8, 9))
    assert lone_stripes(CapturedCode(column_sets=(Stripes(bits=3),))) == ()
    assert lone_stripes(GrayCode()) == ()

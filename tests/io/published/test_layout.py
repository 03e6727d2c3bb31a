from __future__ import annotations

from dsl_core.io.published.layout import FileRecord, as_published


def test_what_is_optional_may_be_absent_and_everything_else_is_wanted() -> None:
    records = [
        FileRecord("a", "a", "ok", ""),
        FileRecord("b", "b", "ok", ""),
        FileRecord("c", None, "missing", "put it there"),
        FileRecord("d", None, "optional", ""),
    ]
    assert as_published(records) == (2, 3)

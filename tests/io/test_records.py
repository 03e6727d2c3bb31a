"""Records come back from their files, and errors say what is wrong with a file."""

from __future__ import annotations

from pathlib import Path

import pytest

from dsl_core.errors import PlanError, StoreError
from dsl_core.io.records import read_record, replace_record, write_record
from dsl_core.model.plan import CapturePlan

PLAN = CapturePlan(name="a plan")


def test_records_come_back_and_are_replaced_only_when_told_to(tmp_path: Path) -> None:
    path = write_record(tmp_path / "plan.json", PLAN)
    assert read_record(path, CapturePlan) == PLAN
    with pytest.raises(StoreError, match="already exists"):
        write_record(path, PLAN)
    other = CapturePlan(name="another")
    replace_record(path, other)
    assert read_record(path, CapturePlan) == other


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (
            "{",
            r"^The plan \S+ is wrong: the file is not JSON \(.*\); it may be cut off\. Repair it\.$",
        ),
        ("[]", r"is wrong: the file does not contain a JSON object\. Repair it\.$"),
        ('{"schema_version": 7, "size": 3}', "it has schema version 7; this program supports version 1"),
        ('{"name": 3}', r"name must be a text \(given 3\)\. Repair it"),
        (
            '{"name": 3, "a": 1, "b": 2}',
            r"name must .*; a is not a field of it \(given 1\); and 1 more\. Repair it",
        ),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, content: str, says: str) -> None:
    (tmp_path / "plan.json").write_text(content)
    with pytest.raises(PlanError, match=says):
        read_record(
            tmp_path / "plan.json",
            CapturePlan,
            "Repair it.",
            called="The plan",
            fault="is wrong",
            error=PlanError,
            most=2,
        )


@pytest.mark.parametrize(
    ("content", "says"), [(None, "No such file"), (b"\xff\xfe", "it is not a text file")]
)
def test_what_cannot_be_read_is_not_called_damaged(tmp_path: Path, content: bytes | None, says: str) -> None:
    path = tmp_path / "plan.json"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(StoreError, match=rf"plan\.json cannot be read \({says}"):
        read_record(path, CapturePlan)


def test_of_many_wrong_fields_one_is_named_unless_more_are_asked_for(tmp_path: Path) -> None:
    (tmp_path / "plan.json").write_text('{"name": 3, "a": 1, "b": 2}')
    with pytest.raises(StoreError, match=r"name must be a text \(given 3\); and 2 more\."):
        read_record(tmp_path / "plan.json", CapturePlan)


def test_a_file_with_the_mark_that_windows_puts_first_is_read(tmp_path: Path) -> None:
    path = write_record(tmp_path / "plan.json", PLAN)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert read_record(path, CapturePlan) == PLAN


def test_a_name_that_is_not_in_utf_8_is_told(tmp_path: Path) -> None:
    plan = PLAN.model_copy(update={"name": "B\udce4ume"})
    with pytest.raises(StoreError, match=r"plan\.json cannot be written: .* not in UTF-8\. Rename"):
        write_record(tmp_path / "plan.json", plan)

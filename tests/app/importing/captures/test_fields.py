"""Every field of a mapping can be changed; what is not possible is said, and changes nothing."""

from __future__ import annotations

import pytest
from dsl_app.importing.captures.fields import (
    first_mapping,
    moved_part,
    part_fields,
    part_words,
    picture_fields,
    with_field,
    with_part,
    with_part_field,
    with_projector,
    without_part,
)

from dsl_core.errors import StoreError
from dsl_core.io.pictures.mapping import (
    BlackPicture,
    Mapping,
    PhasePictures,
    RawLayout,
    Skipped,
    StripePictures,
    WhitePicture,
)

MAPPING = Mapping(
    parts=(WhitePicture(), BlackPicture(), StripePictures(bits=5)),
    projector_size_px=(32, 24),
    unsure=(
        "columns fall along the picture",
        "a projector of 32 x 24 px is assumed",
        "JPEG has changed values",
    ),
)


def test_every_field_of_the_records_is_offered() -> None:
    def offered(part: StripePictures | PhasePictures | Skipped | WhitePicture) -> set[str]:
        return {field.key for field in part_fields(part)}

    phases = PhasePictures(fringes=(1, 8), steps=4)
    for part in (StripePictures(bits=5), phases, Skipped(), WhitePicture()):
        assert offered(part) == set(type(part).model_fields)
    raw = with_field(MAPPING, "raw", True)
    keys = {field.key for field in picture_fields(raw)}
    inner = {f"raw.{key}" for key in RawLayout.model_fields}
    # Name, parts, projector and doubts have places of their own in the dialog.
    elsewhere = {"schema_version", "name", "parts", "projector_size_px", "unsure"}
    assert keys == (set(Mapping.model_fields) - elsewhere) | inner


@pytest.mark.parametrize(
    ("key", "value", "kept"),
    [
        ("bits", 7, 7), ("code", "xor", "xor"), ("inverse_first", True, True), ("first", "least", "least"),
        ("files", "a_*.png, b.png", ("a_*.png", "b.png")), ("axis", "rows", "rows"), ("offset", 3, 3),
    ],
)  # fmt: skip
def test_a_field_of_a_part_is_changed(key: str, value: object, kept: object) -> None:
    changed = with_part_field(MAPPING, 2, key, value)
    assert getattr(changed.parts[2], key) == kept
    assert changed.parts[:2] == MAPPING.parts[:2]


def test_fringes_are_a_list_with_commas() -> None:
    phases = with_part_field(MAPPING, 2, "kind", "phases")
    changed = with_part_field(phases, 2, "fringes", "1, 16")
    assert part_words(changed.parts[2]) == "columns, 1, 16 fringes, 4 steps"
    with pytest.raises(StoreError, match="fringes must be numbers, such as 1, 8, 64, not 'many'"):
        with_part_field(phases, 2, "fringes", "many")


def test_another_kind_keeps_axis_and_files() -> None:
    rows = with_part_field(with_part_field(MAPPING, 2, "axis", "rows"), 2, "files", "r*.png")
    part = with_part_field(rows, 2, "kind", "phases").parts[2]
    assert isinstance(part, PhasePictures)
    assert (part.axis, part.files) == ("rows", ("r*.png",))


def test_parts_are_added_moved_and_removed() -> None:
    more = with_part(MAPPING, 1, "stripes")
    assert [part.kind for part in more.parts] == ["white", "stripes", "black", "stripes"]
    assert isinstance(more.parts[1], StripePictures)
    assert more.parts[1].bits == 5
    assert [part.kind for part in moved_part(more, 3, -3).parts] == ["stripes", "white", "stripes", "black"]
    assert moved_part(more, 0, -1).parts == more.parts
    assert [part.kind for part in without_part(more, 0).parts] == ["stripes", "black", "stripes"]


def test_what_is_not_possible_is_said() -> None:
    with pytest.raises(StoreError, match="no part is of stripes or phases"):
        without_part(MAPPING, 2)
    with pytest.raises(StoreError, match="bits must be at most 16"):
        with_part_field(MAPPING, 2, "bits", 40)
    with pytest.raises(StoreError, match="must name at least one file"):
        with_field(MAPPING, "files", " ")
    with pytest.raises(StoreError, match="files must be names inside the folder"):
        with_field(MAPPING, "files", "../*.png")
    with pytest.raises(StoreError, match="missing must be places from 0"):
        with_field(MAPPING, "missing", "first")


def test_fields_of_files_are_changed() -> None:
    changed = with_field(with_field(MAPPING, "missing", "3, 17"), "full_scale", 0.0)
    assert (changed.missing, changed.full_scale) == ((3, 17), None)
    raw = with_field(with_field(MAPPING, "raw", True), "raw.width_px", 890)
    assert raw.raw is not None
    assert raw.raw.width_px == 890
    assert with_field(raw, "raw", False).raw is None


def test_a_doubt_is_settled_by_who_changes_what_it_is_about() -> None:
    assert len(with_projector(MAPPING, (64, 48)).unsure) == 2
    assert with_part_field(MAPPING, 2, "first", "least").unsure == MAPPING.unsure[1:]
    assert with_part_field(MAPPING, 0, "files", "w.png").unsure == MAPPING.unsure


def test_a_person_begins_with_as_many_digits_as_there_are_pictures() -> None:
    made = first_mapping(12, (0, 0))
    assert [part_words(part) for part in made.parts] == [
        "white", "black", "columns, gray, 5 bits, most first, inverse interleaved",
    ]  # fmt: skip
    assert made.projector_size_px == (1024, 768)
    assert first_mapping(3, (8, 4)).projector_size_px == (8, 4)

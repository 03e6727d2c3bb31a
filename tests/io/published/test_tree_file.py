"""Numbers by name from XML, YAML and JSON: OpenCV's own files, those of others, and damaged ones."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from dsl_core.errors import CalibrationError
from dsl_core.io.published.tree_file import read_nodes, read_texts

MATRIX = np.array([[1 / 3, -1e-20, 3e5], [0, np.pi, -7.0]])


def _read(folder: Path, name: str, text: str) -> dict[str, object]:
    (folder / name).write_text(text, encoding="utf-8")
    return dict(read_nodes(folder / name))


@pytest.mark.parametrize("name", ["c.xml", "c.yml", "c.json"])
def test_what_opencv_writes_is_read_to_the_last_digit(tmp_path: Path, name: str) -> None:
    file = cv2.FileStorage(str(tmp_path / name), cv2.FILE_STORAGE_WRITE)
    file.write("matrix", MATRIX)
    file.write("row", MATRIX[:1])
    file.write("whole", np.arange(4, dtype=np.int32).reshape(2, 2))
    file.write("odd", np.array([[np.nan, np.inf, -np.inf]]))
    file.write("rms", 0.25)
    file.write("count", 12)
    file.write("note", "made in March")
    file.release()
    nodes = read_nodes(tmp_path / name)
    np.testing.assert_array_equal(nodes["matrix"], MATRIX)
    np.testing.assert_array_equal(nodes["row"], MATRIX[:1])
    np.testing.assert_array_equal(nodes["whole"], [[0, 1], [2, 3]])
    np.testing.assert_array_equal(nodes["odd"], [[np.nan, np.inf, -np.inf]])
    assert (nodes["rms"], nodes["count"], nodes["note"]) == (0.25, 12, None)


def test_files_of_other_programs_nest_names_and_lists(tmp_path: Path) -> None:
    ros = (
        "image_width: 640\ncamera_name: left\n"
        "camera_matrix:\n  rows: 2\n  cols: 2\n  data: [1, 2.5, -3e1, 4]\n"
        "made: 2024-03-01\nis_good: yes\nlens:\n  K: [[1, 2], [3, 4]]\n  T: [1, 2]\n  empty: {}\n"
    )
    nodes = _read(tmp_path, "camera.yaml", ros)
    np.testing.assert_array_equal(nodes["camera_matrix"], [[1, 2.5], [-30, 4]])
    np.testing.assert_array_equal(nodes["lens.K"], [[1, 2], [3, 4]])
    np.testing.assert_array_equal(nodes["lens.T"], [1, 2])
    assert nodes["image_width"] == 640
    assert [nodes[name] for name in ("camera_name", "made", "is_good")] == [None] * 3
    nodes = _read(tmp_path, "c.json", '{"a": {"b": {"data": [[1], [2]], "rows": 2}}, "c": true, "d": [1]}')
    np.testing.assert_array_equal(nodes["a.b"], [[1], [2]])
    assert nodes["c"] is None
    np.testing.assert_array_equal(nodes["d"], [1])


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("c.yml", "a: {unit: mm, b: 2}\nnote: made in March\n"),
        ("c.xml", "<r><a><unit>mm</unit><b>2</b></a><note>made in March</note></r>"),
    ],
)
def test_what_a_file_says_in_words_has_a_name_too(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    assert {"a.unit": "mm"}.items() <= read_texts(tmp_path / name).items()
    assert "a.b" not in read_texts(tmp_path / name)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("c.yml", "a: {b: 1}\na: {b: 2}\nc: 3\n"),
        ("c.json", '{"a": {"b": 1}, "a": {"b": 2}, "c": 3}'),
        ("c.xml", "<r><a><b>1</b></a><a><b>2</b></a><c>3</c></r>"),
    ],
)
def test_of_two_with_one_name_none_is_taken(tmp_path: Path, name: str, text: str) -> None:
    assert _read(tmp_path, name, text) == {"a": None, "c": 3.0}


@pytest.mark.parametrize(
    ("name", "text", "encoding"),
    [
        ("c.yml", "# -*- mode: yaml -*-\n# x_p = R *x_c + t\nby: Smith &Co, *all\na: &k [1, 2]\n", "utf-8"),
        ("c.yml", "# Größe – in Pixeln\na: [1, 2]\n", "cp1252"),
        ("c.yml", "by: Grüße\na: [1, 2]\n", "utf-16"),
        ("c.json", '{"by": "Grüße", "a": [1, 2]}', "utf-16-le"),
        ("c.json", '{"by": "Grüße", "a": [1, 2]}', "utf-8-sig"),
        (
            "c.xml",
            '<?xml version="1.0" encoding="ISO-8859-1"?><r><by>Grüße</by><a>1 2</a></r>',
            "latin-1",
        ),
        ("c.xml", '<?xml version="1.0" encoding="UTF-16"?><r><by>Grüße</by><a>1 2</a></r>', "utf-16"),
    ],
)
def test_sound_files_are_read_whatever_their_notes(
    tmp_path: Path, name: str, text: str, encoding: str
) -> None:
    (tmp_path / name).write_bytes(text.encode(encoding))
    np.testing.assert_array_equal(read_nodes(tmp_path / name)["a"], [1, 2])


def test_values_that_are_repeated_by_reference_are_named(tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match=r"repeats values by references such as \*id001"):
        _read(tmp_path, "c.yml", "a: &id001 [1, 2]\nb: *id001\n")


@pytest.mark.parametrize(
    "matrix",
    [
        "{rows: 2, cols: 2, data: [1, 2, 3]}",
        "{rows: 0, cols: 0, data: []}",
        "{rows: -1, cols: -2, data: [1, 2]}",
        "{rows: nan, cols: 2, data: [1, 2]}",
        "{rows: 99999999999999999999, cols: 1, data: [1]}",
        "{rows: two, cols: 1, data: [1, 2]}",
        "{rows: 3, data: [1, 2]}",
        "{rows: 1.5, cols: 2, data: [1, 2, 3]}",
        "[[1, 2], [3]]",
        "[1, [2, 3]]",
        "[1, x]",
        "[1_0, 2]",
        "[[[1, {a: 1}]]]",
    ],
)
def test_what_is_not_a_whole_matrix_is_none(tmp_path: Path, matrix: str) -> None:
    assert _read(tmp_path, "c.yml", f"m: {matrix}\n") == {"m": None}


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("c.yml", "a: [1, 2\n"),
        ("c.yml", "a: b: c: d\n"),
        ("c.yml", "- 1\n- 2\n"),
        ("c.yml", "? [1, 2]\n: 3\n"),
        ("c.yml", "a: 1\n--- \nb: 2\n"),
        ("c.yml", ""),
        ("c.xml", "<a><b></a>"),
        ("c.xml", "<a>"),
        ("c.xml", "<a>1</a>"),
        ("c.json", '{"a": 1'),
    ],
)
def test_what_cannot_be_read_is_refused_in_a_sentence(tmp_path: Path, name: str, text: str) -> None:
    with pytest.raises(CalibrationError, match=r"is not a calibration that can be read: .*Export"):
        _read(tmp_path, name, text)


@pytest.mark.parametrize(
    "text",
    [
        "a: " + 21 * "[" + 21 * "]",
        21 * "<a>" + 21 * "</a>",
        '<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>',
        "\n".join(" " * depth + "a:" for depth in range(202)),
    ],
)
def test_what_nests_too_deeply_is_refused_before_it_is_parsed(tmp_path: Path, text: str) -> None:
    with pytest.raises(CalibrationError, match="nested too deeply"):
        _read(tmp_path, "c.yml", text)


def test_names_are_taken_from_five_levels_and_only_so_many(tmp_path: Path) -> None:
    assert _read(tmp_path, "c.yml", "a: {b: {c: {d: {e: 1}}}}\n") == {"a.b.c.d.e": 1.0}
    assert _read(tmp_path, "c.yml", "a: {b: {c: {d: {e: {f: 1}}}}}\n") == {"a.b.c.d.e": None}
    many = "\n".join(f"n{i}: {i}" for i in range(2100))
    assert len(_read(tmp_path, "c.yml", many)) == 2000


def test_flipped_and_lost_bytes_end_in_numbers_or_a_sentence(tmp_path: Path) -> None:
    """OpenCV's reader of YAML corrupts memory on some of these."""
    path = tmp_path / "c.yml"
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    file.write("matrix", MATRIX)
    file.write("rms", 0.25)
    file.release()
    sound, rng = path.read_bytes(), np.random.default_rng(1)
    refused = 0
    for _ in range(400):
        damaged = bytearray(sound)
        for at in rng.integers(0, len(sound), int(rng.integers(1, 6))):
            damaged[at] = rng.integers(0, 256)
        path.write_bytes(bytes(damaged[: int(rng.integers(1, len(sound) + 1))]))
        try:
            read_nodes(path)
        except CalibrationError:
            refused += 1
    assert 0 < refused < 400

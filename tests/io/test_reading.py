"""Files of strangers: what is no plain file, or far too large, is refused before it is read."""

from __future__ import annotations

import io
import os
import sys
from pathlib import Path

import pytest

from dsl_core.io.reading import array_header, parts_of, read_bounded, read_json, require_plain


def test_plain_files_and_links_to_them_are_read(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"content")
    (tmp_path / "link").symlink_to(tmp_path / "file")
    assert read_bounded(tmp_path / "link") == b"content"
    assert require_plain(tmp_path / "file") == 7
    assert read_bounded(tmp_path / "file", 7) == b"content"
    with pytest.raises(OSError, match="larger than"):
        read_bounded(tmp_path / "file", 6)


@pytest.mark.skipif(sys.platform == "win32", reason="pipes have no place in folders there")
def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to(tmp_path / "pipe")
    for name in ("pipe", "link"):
        with pytest.raises(OSError, match="a pipe or a device"):
            read_bounded(tmp_path / name)


def test_folders_missing_files_and_names_that_no_file_has(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="a folder, not a file"):
        read_bounded(tmp_path)
    with pytest.raises(FileNotFoundError):
        read_bounded(tmp_path / "nothing")
    with pytest.raises(OSError, match="a character that no file can have"):
        read_bounded(tmp_path / "a\0b")


@pytest.mark.parametrize("content", ["[" * 100_000, '{"a": ' + "9" * 6000 + "}", "{", '{"a": "\ud800"'])
def test_json_that_python_cannot_hold(tmp_path: Path, content: str) -> None:
    (tmp_path / "a.json").write_bytes(content.encode("utf-8", "surrogatepass"))
    with pytest.raises(ValueError, match=r"nested|digits|Expecting|decode"):
        read_json(tmp_path / "a.json")


def test_parts_of_a_file_are_those_bytes(tmp_path: Path) -> None:
    path = tmp_path / "bytes"
    path.write_bytes(bytes(range(200)))
    with parts_of(path) as content:
        assert len(content) == 200
        assert content[150:160] == bytes(range(150, 160))
        assert content[:3] == b"\x00\x01\x02"
        assert content[190:500] == bytes(range(190, 200))
        assert content[20:10] == b""
    with pytest.raises(OSError, match="larger than"), parts_of(path, 100):
        pass


def test_a_header_that_no_array_needs_is_not_read() -> None:
    size = 10**9
    file = io.BytesIO(b"\x93NUMPY\x02\x00" + size.to_bytes(4, "little") + bytes(1 << 20))
    with pytest.raises(ValueError, match="its header declares 1000000000 bytes"):
        array_header(file)
    assert file.tell() == 12

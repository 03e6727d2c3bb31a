"""Some rows of a mosaic, from the blocks that hold them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dsl_core.io.scan.blosc_blocks import HEADER, blocks_of
from dsl_core.io.scan.frame_store import ChunkError, FrameStore


@pytest.fixture(scope="module")
def mosaic() -> np.ndarray:
    """Ten blocks and a shorter one."""
    return np.random.default_rng(0).integers(100, 140, (330, 1000)).astype(np.uint16)


@pytest.fixture
def store(tmp_path: Path, mosaic: np.ndarray) -> FrameStore:
    made = FrameStore(tmp_path / "frames", 2, *mosaic.shape)
    made.create()
    made.write(0, mosaic)
    return made


@pytest.mark.parametrize(("first", "last"), [(0, 330), (0, 1), (130, 133), (131, 270), (329, 330)])
def test_rows_are_those_of_the_mosaic(store: FrameStore, mosaic: np.ndarray, first: int, last: int) -> None:
    np.testing.assert_array_equal(store.read_rows(0, slice(first, last)), mosaic[first:last])


def test_rows_of_a_mosaic_that_could_not_be_compressed(store: FrameStore) -> None:
    noise = np.random.default_rng(1).integers(0, 65536, (330, 1000)).astype(np.uint16)
    store.write(1, noise)
    np.testing.assert_array_equal(store.read_rows(1, slice(100, 300)), noise[100:300])


def test_blocks_shuffled_by_bytes_are_found_as_well(mosaic: np.ndarray) -> None:
    blosc = pytest.importorskip("numcodecs.blosc")
    codec = blosc.Blosc(cname="zstd", clevel=1, shuffle=blosc.SHUFFLE, blocksize=1 << 18)
    part, begins = blocks_of(codec.encode(mosaic), 300_000, 300_010)
    found = np.frombuffer(codec.decode(part), "<u2")
    np.testing.assert_array_equal(found, mosaic.ravel()[begins // 2 :][: found.size])
    assert 0 < begins <= 300_000


def test_only_the_blocks_that_are_needed_are_in_a_part(store: FrameStore) -> None:
    chunk = store.path(0).read_bytes()
    part, begins = blocks_of(chunk, 0, 10)
    assert begins == 0
    assert HEADER.unpack_from(part)[4] == 1 << 16
    assert len(part) < 0.2 * len(chunk)


@pytest.mark.parametrize("place", [4, 12, 16, 20])
def test_a_damaged_head_is_told(store: FrameStore, place: int) -> None:
    chunk = bytearray(store.path(0).read_bytes())
    chunk[place + 3] ^= 0x7F
    store.path(0).write_bytes(chunk)
    with pytest.raises(ChunkError, match="its file"):
        store.read_rows(0, slice(200, 330))


def test_a_missing_or_empty_file_is_told(store: FrameStore) -> None:
    with pytest.raises(ChunkError, match="cannot be read"):
        store.read_rows(1, slice(0, 2))
    store.path(1).write_bytes(b"")
    with pytest.raises(ChunkError, match="cut off"):
        store.read_rows(1, slice(0, 2))


def test_a_whole_of_one_block_is_that_block(tmp_path: Path) -> None:
    small = np.arange(600, dtype=np.uint16).reshape(20, 30) % 7
    made = FrameStore(tmp_path / "few", 1, 20, 30)
    made.create()
    made.write(0, small)
    np.testing.assert_array_equal(made.read_rows(0, slice(3, 9)), small[3:9])
    part, begins = blocks_of(made.path(0).read_bytes(), 0, 600)
    assert begins == 0
    assert HEADER.unpack_from(part)[4] == 1200


def test_the_last_block_comes_with_the_one_before_it(store: FrameStore) -> None:
    # Ten blocks of 64 KiB and a shorter one.
    part, begins = blocks_of(store.path(0).read_bytes(), 656_000, 660_000)
    assert begins == 9 << 16
    assert HEADER.unpack_from(part)[4] == 660_000 - (9 << 16)
    middle, begins = blocks_of(store.path(0).read_bytes(), 1 << 16, 1 << 17)
    assert (begins, HEADER.unpack_from(middle)[4]) == (1 << 16, 1 << 16)


def test_frames_in_blocks_of_another_size_are_read(store: FrameStore, mosaic: np.ndarray) -> None:
    blosc = pytest.importorskip("numcodecs.blosc")
    larger = blosc.Blosc(cname="zstd", clevel=1, shuffle=blosc.BITSHUFFLE, blocksize=1 << 18)
    store.path(0).write_bytes(larger.encode(mosaic))
    metadata = store.folder / "zarr.json"
    metadata.write_text(metadata.read_text().replace("65536", "262144"))
    store.check()
    np.testing.assert_array_equal(store.read_rows(0, slice(150, 300)), mosaic[150:300])

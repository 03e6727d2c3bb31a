"""Reading files that may come from a stranger: plain files only, and of bounded size."""

from __future__ import annotations

import errno
import json
import math
import os
import stat
import tokenize
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO, FileIO, RawIOBase
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from dsl_core.io.sealed import unseal

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

#: More than any plan, rig or campaign file of this program holds.
MOST_BYTES = 64 << 20
#: The most that the first version of NumPy's format can have.
_MOST_HEADER_BYTES = 1 << 16


def there(path: Path) -> bool:
    """Whether something with this path can be seen.

    Not where a folder above it may not be entered or a name is too long: `Path.exists` raises there.
    """
    try:
        return path.exists()
    except OSError:
        return False


def read_bounded(path: Path, most_bytes: int = MOST_BYTES) -> bytes:
    """The content of a file; raises `OSError` for a pipe, a device, a folder and what is larger."""
    if require_plain(path) > most_bytes:
        raise _refusal(path, f"it is larger than {most_bytes / 1e6:.0f} MB, which no file of its kind is")
    with path.open("rb") as file:
        return file.read()


class FileParts:
    """The bytes of a file, of which only those are read that a slice asks for."""

    def __init__(self, file: RawIOBase, size: int) -> None:
        self._file, self._size = file, size

    def __len__(self) -> int:
        """The size of the file."""
        return self._size

    def __getitem__(self, part: slice) -> bytes:
        """Some bytes in a row."""
        start, stop, _ = part.indices(self._size)
        self._file.seek(start)
        return self._file.read(max(stop - start, 0)) or b""


@contextmanager
def parts_of(path: Path, most_bytes: int = MOST_BYTES) -> Iterator[FileParts]:
    """The content of a file without reading what nobody looks at; raises as `read_bounded` does."""
    size = require_plain(path)
    if size > most_bytes:
        raise _refusal(path, f"it is larger than {most_bytes / 1e6:.0f} MB, which no file of its kind is")
    with FileIO(path) as file:
        yield FileParts(file, size)


def read_json(path: Path) -> Any:
    """The value in a JSON file, its checksum removed once it is found to match.

    Raises `OSError` as `read_bounded` does, and ``ValueError`` for what is no JSON, is nested too deeply, or
    does not match its checksum.
    """
    try:
        return json.loads(unseal(read_bounded(path)))
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error


def read_array(path: Path) -> NDArray[Any]:
    """The array in a NumPy file, never one of Python objects.

    Raises `OSError` as `read_bounded` does, and ``ValueError`` for what is no array or declares more than the
    file holds, before anything is allocated for it.
    """
    import numpy as np

    size = require_plain(path)
    with path.open("rb") as file:
        shape, dtype = array_header(file)
        declared = math.prod(shape) * dtype.itemsize
        if declared > size:
            raise ValueError(f"it declares {declared} bytes of values, but has {size} bytes in all")
        file.seek(0)
        array: NDArray[Any] = np.lib.format.read_array(file, allow_pickle=False)
    return array


def array_header(file: IO[bytes]) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Shape and type of the array that an open NumPy file begins with; raises ``ValueError``."""
    import numpy as np

    try:
        version = np.lib.format.read_magic(file)
        is_first = version == (1, 0)
        read = np.lib.format.read_array_header_1_0 if is_first else np.lib.format.read_array_header_2_0
        length = file.read(2 if is_first else 4)
        count = int.from_bytes(length, "little")
        if count > _MOST_HEADER_BYTES:  # of zeros, it may be packed in little
            raise ValueError(f"its header declares {count} bytes, which no header needs")
        shape, _, dtype = read(BytesIO(length + file.read(count)))
    except (SyntaxError, TypeError, tokenize.TokenError, OverflowError) as error:
        # NumPy parses the header as Python, and lets out what the parser says.
        raise ValueError(f"its header is damaged ({type(error).__name__})") from error
    return shape, dtype


def require_plain(path: Path) -> int:
    """The size of a plain file, links to one included.

    Raises `FileNotFoundError`, and `OSError` for anything that is not a plain file: reading a pipe would wait
    for ever.
    """
    try:
        found = os.stat(path)
    except ValueError as error:
        raise _refusal(path, "its name contains a character that no file can have") from error
    if stat.S_ISDIR(found.st_mode):
        raise _refusal(path, "it is a folder, not a file")
    if not stat.S_ISREG(found.st_mode):
        raise _refusal(path, "it is a pipe or a device, not a file")
    return found.st_size


def _refusal(path: Path, why: str) -> OSError:
    return OSError(errno.EINVAL, why, str(path).replace("\0", "\\0"))

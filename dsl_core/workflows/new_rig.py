"""A package for a rig of one's own, made of the files that the help page shows."""

from __future__ import annotations

import keyword
import re
import sys
from importlib.util import find_spec
from pathlib import Path

from dsl_core.errors import StoreError
from dsl_core.io.atomic import make_folder, write_atomic
from dsl_core.resources import resource_path

PAGE = "help/adding-a-rig.md"
#: What stands for the name in the page's files.
_NAME, _MODULE = "my-lab", "my_lab"
#: A file's name in bold, and the text between fences that follows it.
_PARTS = re.compile(r"\*\*`([\w.]+)`\*\*|```(\w*)\n(.*?)```", re.DOTALL)


def page_files() -> dict[str, str]:
    """The files that the help page shows, by their names."""
    files: dict[str, str] = {}
    name = ""
    for said, _, text in _PARTS.findall(resource_path(PAGE).read_text(encoding="utf-8")):
        if said:
            name = said
        elif name:
            files[name], name = text, ""
    return files


def write_new_rig(name: str, folder: Path, taken: list[str]) -> tuple[Path, ...]:
    """Write a package whose rig is called ``name`` into a new folder; returns its files.

    Raises `StoreError` for a name that no package can have or that is ``taken``, and for a folder that is not
    empty.
    """
    if not re.fullmatch(r"[a-z][a-z0-9]*(?:-[a-z0-9]+)*", name) or len(name) > 40:
        raise StoreError(
            f"A rig cannot be called {name!r}: it must be of small letters, digits and single hyphens, and"
            " begin with a letter, such as room-12 or my-lab. Choose another name."
        )
    if keyword.iskeyword(name):
        raise StoreError(f"{name!r} is a word of Python, so no module can have it. Choose another name.")
    if name in taken:
        raise StoreError(f"There is a rig {name!r} already. Choose another name.")
    module = name.replace("-", "_")
    if module in sys.stdlib_module_names or _is_installed(module):
        raise StoreError(
            f"Python has a module {module!r} already, and one of two hides the other. Choose another name."
        )
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise StoreError(f"{folder} exists and is not an empty folder. Choose another folder.")
    make_folder(folder)
    written = []
    for file, text in page_files().items():
        path = folder / file.replace(_MODULE, module)
        write_atomic(path, text.replace(_NAME, name).replace(_MODULE, module).encode("utf-8"))
        written.append(path)
    return tuple(written)


def _is_installed(module: str) -> bool:
    """Whether Python finds a module; to it, a folder without files is one too, but without origin."""
    spec = find_spec(module)
    return spec is not None and spec.origin is not None

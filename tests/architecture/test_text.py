"""Files of the repository hold no paths of a machine, no left-overs, and nothing of a private registry."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = (".ci", "app", "docs", "dsl_core", "packaging", "resources", "tests")
TEXT = {"", ".bib", ".csv", ".html", ".j2", ".json", ".md", ".py", ".toml", ".txt", ".yaml", ".yml"}
FORBIDDEN = {
    "path of a machine": r"(?<![\w.~/-])/(?:home|root|opt|Users|mnt|srv|work)/\w",
    "left-over": r"\b(?:TODO|FIXME|HACK|XXX)\b",
    "address of a registry": r"--(?:extra-)?index-url|files\.pythonhosted",
}


def files() -> Iterator[Path]:
    yield from (path for path in ROOT.iterdir() if path.is_file() and path.suffix in TEXT)
    for folder in FOLDERS:
        for path in (ROOT / folder).rglob("*"):
            is_text = path.suffix in TEXT and "__pycache__" not in path.parts
            # Chunks of arrays have names without an ending.
            if is_text and path.is_file() and not any(part.endswith(".zarr") for part in path.parts[:-1]):
                yield path


@pytest.mark.parametrize("kind", FORBIDDEN)
def test_no_file_holds_it(kind: str) -> None:
    pattern = re.compile(FORBIDDEN[kind])
    found = [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()[:80]}"
        for path in files()
        if path != Path(__file__).resolve()
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if pattern.search(line)
    ]
    assert found == []


def test_packaging_is_no_package() -> None:
    """A folder of that name with an __init__.py would hide the library `packaging`."""
    assert not (ROOT / "packaging" / "__init__.py").exists()

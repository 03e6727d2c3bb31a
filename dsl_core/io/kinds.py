"""What there is instead of what was wanted, for the sentences of errors."""

from __future__ import annotations

from pathlib import Path

from dsl_core.io import CAMPAIGN_NAME, MANIFEST_NAME

#: Kinds of folders by a file that each contains.
_TOLD_BY = {
    MANIFEST_NAME: "it is a scan; 'dsl-scan reconstruct' makes a result of it",
    CAMPAIGN_NAME: "it is the folder of a campaign of calibrations",
    "zarr.json": "it is a result or another folder of zarr, without the frames of a scan",
}


def whose_inside(path: Path) -> str:
    """The scan or result in whose folder a path would be, as ``the scan FOLDER``; empty for none.

    What is added there is no part of it, and copies or checks of the folder would trip over it.
    """
    for above in path.absolute().parents:
        if (above / MANIFEST_NAME).is_file() and (above / "frames.jsonl").is_file():
            return f"the scan {above}"
        if (above / "zarr.json").is_file():
            return f"{above}, a result or another folder of zarr"
    return ""


def what_is_at(path: Path) -> str:
    """What a path holds, as a clause that follows "PATH is not a scan:"."""
    if not path.exists():
        return "there is nothing of that name now; it may have been moved or deleted"
    if not path.is_dir():
        return "it is a file"
    told = next((words for name, words in _TOLD_BY.items() if (path / name).exists()), None)
    return told or ("it is a folder of other files" if any(path.iterdir()) else "it is an empty folder")

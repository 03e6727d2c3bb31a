"""A page with all pictures: a row for each, a column for each look."""

from __future__ import annotations

from html import escape
from pathlib import Path

from tests.screens.look import pictures

_STYLE = (
    "body{font:14px sans-serif;margin:16px;background:#888}td,th{padding:4px;vertical-align:top}"
    "img{width:100%;min-width:360px}th{text-align:left}"
)


def write_gallery(folder: Path) -> Path:
    """Write ``index.html`` beside the pictures."""
    found = pictures(folder)
    names = sorted({picture.name for each in found.values() for picture in each})
    head = "".join(f"<th>{escape(look)}</th>" for look in found)
    rows = "".join(_row(name, folder, list(found)) for name in names)
    target = folder / "index.html"
    target.write_text(
        f"<!doctype html><meta charset=utf-8><title>Screens</title><style>{_STYLE}</style>"
        f"<table><tr>{head}</tr>{rows}</table>",
        encoding="utf-8",
    )
    return target


def _row(name: str, folder: Path, looks: list[str]) -> str:
    cells = []
    for look in looks:
        path = f"{look}/{name}"
        there = (folder / path).is_file()
        cells.append(
            f'<td><a href="{path}"><img loading=lazy src="{path}"></a></td>' if there else "<td>–</td>"
        )
    title = escape(name.removesuffix(".png"))
    return f'<tr><th colspan="{len(looks)}">{title}</th></tr><tr>{"".join(cells)}</tr>'

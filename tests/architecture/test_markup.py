"""No text of a file is shown as markup: it could load a picture or pose as part of the window."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
#: Calls that show a tooltip, each with the place of its text.
TIPS = {"setToolTip": -1, "setTabToolTip": -1, "showText": 1}
#: Widgets that guess whether a text is markup.
GUESSING = {"QLabel", "QMessageBox"}


def modules() -> Iterator[tuple[str, list[ast.Call]]]:
    for path in sorted((ROOT / "app").rglob("*.py")):
        found = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        yield path.relative_to(ROOT).as_posix(), [each for each in found if isinstance(each, ast.Call)]


def name_of(call: ast.AST) -> str:
    function = call.func if isinstance(call, ast.Call) else None
    return getattr(function, "attr", getattr(function, "id", ""))


def test_tooltips_are_written_here_or_made_plain() -> None:
    raw = []
    for path, calls in modules():
        for call in calls:
            if name_of(call) == "setItemData" and "ToolTipRole" in ast.unparse(call):
                text = call.args[1]
            elif name_of(call) in TIPS:
                text = call.args[TIPS[name_of(call)]]
            else:
                continue
            if not isinstance(text, ast.Constant) and name_of(text) != "plain_tip":
                raw.append(f"{path}:{call.lineno}: {ast.unparse(call)}")
    assert raw == []


def test_labels_and_messages_do_not_guess_what_is_markup() -> None:
    guessing = []
    for path, calls in modules():
        if any(name_of(call) == "setTextFormat" for call in calls):
            continue
        made = [call for call in calls if name_of(call) in GUESSING]
        fixed = [call for call in made if call.args and isinstance(call.args[0], ast.Constant)]
        guessing += [f"{path}:{call.lineno}: {ast.unparse(call)}" for call in made if call not in fixed]
    assert guessing == []

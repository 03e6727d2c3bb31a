"""The text that users read: strings of the program, help, reports and README.

``python -m tests.architecture.words`` lists it. With a revision of git, such as ``HEAD~40``, it lists what
has changed since: strings removed with ``-``, added with ``+``, by file.
"""

from __future__ import annotations

import argparse
import ast
import subprocess
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
#: Where the window's and the engine's strings are; docstrings of commands are what ``--help`` prints.
CODE, COMMANDS = ("app/", "dsl_core/"), "dsl_core/cli/"
PROSE = ("resources/help/", "resources/report/", "README.md")


class Text(NamedTuple):
    """A piece of text, with its file and line."""

    path: str
    line: int
    text: str


def texts_of_module(path: str, source: str) -> Iterator[Text]:
    """Strings of two words or more in a module; docstrings only where a command prints them."""
    tree = ast.parse(source)
    docstrings = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef)
        and node.body
        and isinstance(node.body[0], ast.Expr)
    }
    inside = {
        id(part)
        for node in ast.walk(tree)
        if isinstance(node, ast.JoinedStr)
        for part in ast.walk(node)
        if part is not node
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            text = "".join(
                str(part.value) if isinstance(part, ast.Constant) else "{}" for part in node.values
            )
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in inside:
            if id(node) in docstrings and not path.startswith(COMMANDS):
                continue
            text = node.value
        else:
            continue
        if " " in text.strip():
            yield Text(path, node.lineno, text)


def texts(paths: list[str], read: Callable[[str], str]) -> Iterator[Text]:
    """All text among files, by their paths in the repository."""
    for path in paths:
        if path.startswith(CODE) and path.endswith(".py"):
            yield from texts_of_module(path, read(path))
        elif path.startswith(PROSE) and path.endswith((".md", ".j2")):
            for number, line in enumerate(read(path).splitlines(), 1):
                if line.strip():
                    yield Text(path, number, line)


@cache
def texts_now() -> tuple[Text, ...]:
    """The text of the working tree, as it was at first."""
    paths = [
        str(path.relative_to(ROOT).as_posix())
        for folder in ("app", "dsl_core", "resources")
        for path in sorted((ROOT / folder).rglob("*.*"))
    ]
    return tuple(texts([*paths, "README.md"], lambda path: (ROOT / path).read_text(encoding="utf-8")))


def texts_at(revision: str) -> Iterator[Text]:
    """The text at a revision of git."""

    def git(*words: str) -> str:
        return subprocess.run(
            ["git", *words], cwd=ROOT, capture_output=True, text=True, check=True, encoding="utf-8"
        ).stdout

    paths = git("ls-tree", "-r", "--name-only", revision).splitlines()
    return texts(paths, lambda path: git("show", f"{revision}:{path}"))


def main() -> None:
    """List the text, or what has changed of it."""
    parser = argparse.ArgumentParser(description="List the text that users read.")
    parser.add_argument("since", nargs="?", help="revision of git to compare with")
    since = parser.parse_args().since
    now = texts_now()
    if since is None:
        for each in now:
            print(f"{each.path}:{each.line}: {each.text.strip()}")
        return
    before = list(texts_at(since))
    old, new = ({each.text for each in both} for both in (before, now))
    for sign, both, other in (("-", before, new), ("+", now, old)):
        for each in both:
            if each.text not in other:
                print(f"{sign} {each.path}: {each.text.strip()}")


if __name__ == "__main__":
    main()

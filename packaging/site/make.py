"""Gather the pages of the site from where their texts are, and build it: ``run.py site``.

No text is written twice: the guide is the help of the window, the tutorials are the notebooks of
``examples``, commands and functions describe themselves. Links between
files of the repository become links between pages.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGES = ROOT / "build" / "site" / "pages"
CONFIG = ROOT / "packaging" / "site" / "mkdocs.yml"
HELP = ROOT / "resources" / "help"
PICTURES = ROOT / "resources" / "pictures"
#: Pages of the guide by what a reader wants; pages that are in none follow at the end.
GUIDE = {
    "Measure": (
        "rig",
        "calibrating",
        "scanning",
        "reconstructing-again",
        "collections",
        "comparing",
        "exporting",
        "importing",
    ),
    "Understand": (
        *("how-it-measures", "numbers", "hard-cases", "reading-an-intensity-graph", "accuracy-against-time"),
        *("designed-patterns", "effects-of-the-twin", "glossary"),
    ),
    "Extend": ("scripting", "connecting-devices", "adding-a-rig", "adding-a-format", "files"),
}
TUTORIALS = ("first_scan", "read_spectra", "many_scans")
#: Files at the top of the repository that are pages, by their names there.
DOCUMENTS = {
    "README.md": "index.md",
    "ARCHITECTURE.md": "project/architecture.md",
    "CHANGELOG.md": "project/changelog.md",
    "CONTRIBUTING.md": "project/contributing.md",
    "CODE_OF_CONDUCT.md": "project/conduct.md",
}


def main() -> int:
    """Run the notebooks, gather and build; returns the exit code of what failed, or 0."""
    for name in () if "--no-run" in sys.argv else TUTORIALS:
        with tempfile.TemporaryDirectory() as folder:
            script = [sys.executable, "-W", "error", str(ROOT / "examples" / f"{name}.py")]
            code = subprocess.run(
                script, cwd=folder, check=False, env=os.environ | {"MPLBACKEND": "agg"}
            ).returncode
        if code:
            return code
    gather()
    config = PAGES.parent / "mkdocs.yml"
    # The two folders are relative to the file, which moves.
    text = CONFIG.read_text(encoding="utf-8").replace("../../build/site/", "").replace("[../..]", f"[{ROOT}]")
    config.write_text(f"{text}nav: {json.dumps(navigation())}\n", encoding="utf-8")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--config-file", str(config)]
    quiet = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    code = subprocess.run(command, check=False, env=quiet).returncode
    if code == 0:
        print(f"The site is in {PAGES.parent / 'html'}: {len(list(PAGES.rglob('*.md')))} pages")
    return code


def gather() -> None:
    """Put every page into the folder of the builder."""
    shutil.rmtree(PAGES, ignore_errors=True)
    for name, page in DOCUMENTS.items():
        write(page, (ROOT / name).read_text(encoding="utf-8"))
    for path in sorted(HELP.glob("*.md")):
        write(f"guide/{path.name}", path.read_text(encoding="utf-8"))
    for name in TUTORIALS:
        source = (ROOT / "examples" / f"{name}.py").read_text(encoding="utf-8")
        write(f"tutorials/{name}.md", page_of(source, name))
        notebook = PAGES / "tutorials" / f"{name}.ipynb"
        notebook.write_text(json.dumps(notebook_of(source), indent=1), encoding="utf-8")
    write("reference/python.md", python_page())
    write("reference/commands.md", commands_page())
    shutil.copytree(PICTURES, PAGES / "pictures")


def write(page: str, text: str) -> None:
    """Write a page, with the links of the repository turned into links of the site."""
    depth = "../" * page.count("/")

    def moved(found: re.Match[str]) -> str:
        label, target, anchor = found.groups()
        name = target.removeprefix("./")
        if name in DOCUMENTS:
            name = DOCUMENTS[name]
        elif name.startswith("resources/help/"):
            name = "guide/" + name.removeprefix("resources/help/")
        elif name.startswith("resources/pictures/"):
            name = name.removeprefix("resources/")
        elif page.startswith(("guide/", "tutorials/")):
            return found[0]
        else:  # a file of the repository that is no page
            return label[1:-1]
        return f"{label}({depth}{name}{anchor or ''})"

    text = re.sub(r"(!?\[[^\]]*\])\((?!https?:)([^)#\s]+)(#[^)\s]*)?\)", moved, text)
    path = PAGES / page
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


def cells(source: str) -> list[tuple[str, str]]:
    """The cells of a notebook that is written as a script: their kind, markdown or code, and their text."""
    found = []
    for part in re.split(r"(?m)^# %%", source)[1:]:
        head, _, body = part.partition("\n")
        if head.strip() == "[markdown]":
            found.append(("markdown", re.sub(r"(?m)^# ?", "", body).strip()))
        else:
            found.append(("code", body.strip()))
    return found


def page_of(source: str, name: str) -> str:
    """A notebook as a page."""
    parts = [f"```python\n{text}\n```" if kind == "code" else text for kind, text in cells(source)]
    return "\n\n".join([*parts, f"[The same as a Jupyter notebook]({name}.ipynb)"]) + "\n"


def notebook_of(source: str) -> dict[str, object]:
    """A notebook in the format of Jupyter, version 4."""
    made: list[dict[str, object]] = []
    for kind, text in cells(source):
        cell: dict[str, object] = {
            "cell_type": kind,
            "metadata": {},
            "source": text.splitlines(keepends=True),
        }
        made.append(cell | ({"outputs": [], "execution_count": None} if kind == "code" else {}))
    return {"cells": made, "metadata": {}, "nbformat": 4, "nbformat_minor": 4}


def python_page() -> str:
    """Every public name of the package."""
    import dsl_core

    names = [name for name in dsl_core.__all__ if not name.startswith("__")]
    parts = [
        f"# Python\n\n`import dsl_core as dsl` brings {len(names)} names; each loads when it is first used."
    ]
    parts += [f"::: dsl_core.{name}" for name in names]
    parts += [
        "::: dsl_core.api.accessor.ResultAccessor",
        "::: dsl_core.errors",
        "::: dsl_core.model.options.Options",
        "::: dsl_core.planning.expected.Prediction",
    ]
    return "\n\n".join(parts) + "\n"


def commands_page() -> str:
    """Every command with its arguments and options, from what the commands say of themselves."""
    import typer

    from dsl_core.cli.run import app

    parts = [
        "# Commands\n\nEach takes `--help`, most `--json`. Exit codes: 0 success, 2 wrong input, 130 stopped."
    ]
    for name, command in walk(typer.main.get_command(app), "dsl-scan"):
        about = (command.help or "").strip()
        arguments = [each for each in command.params if each.param_type_name == "argument"]
        options = [each for each in command.params if each.param_type_name == "option"]
        usage = " ".join([name, *(each.metavar or each.name.upper() for each in arguments)])
        parts.append(f"## {name.removeprefix('dsl-scan ')}\n\n{about}\n\n```\n{usage}\n```")
        rows = [
            f"| `{'`, `'.join([*each.opts, *each.secondary_opts])}` | {cell(each.help)} |" for each in options
        ]
        rows = [row for row in rows if "`--help`" not in row]
        if rows:
            parts.append("\n".join(["| option | meaning |", "|---|---|", *rows]))
    return "\n\n".join(parts) + "\n"


def walk(command: object, name: str) -> list[tuple[str, object]]:
    """A command and all below it, by their full names."""
    below = getattr(command, "commands", None)
    if below is None:
        return [(name, command)]
    found = (
        []
        if name == "dsl-scan"
        else [(name, command)]
        if getattr(command, "invoke_without_command", False)
        else []
    )
    for each in below.values():
        found += walk(each, f"{name} {each.name}")
    return found


def cell(text: str | None) -> str:
    """A text for a cell of a table."""
    return " ".join((text or "").split()).replace("|", "\\|")


def navigation() -> list[dict[str, object]]:
    """What the site lists on its left."""
    named = {name for names in GUIDE.values() for name in names}
    rest = [path.stem for path in sorted(HELP.glob("*.md")) if path.stem not in named]
    guide: list[dict[str, object]] = [
        {title: [f"guide/{name}.md" for name in names if (HELP / f"{name}.md").exists()]}
        for title, names in GUIDE.items()
    ]
    if rest:
        guide.append({"More": [f"guide/{name}.md" for name in rest]})
    return [
        {"Start": "index.md"},
        {"Tutorials": [f"tutorials/{name}.md" for name in TUTORIALS]},
        *guide,
        {"Reference": ["reference/python.md", "reference/commands.md"]},
        {"Project": [page for page in DOCUMENTS.values() if page != "index.md"]},
    ]


if __name__ == "__main__":
    sys.exit(main())

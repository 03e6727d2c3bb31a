"""Do the tests notice a fault? Single-line faults at random places, each run against the tests of its folder.

``python -m tests.benchmarks.bench_mutations --seed 1 --count 60`` copies the tree, puts one fault at a time
into the copy, runs the tests of the fault's folder until one fails, and lists which faults were caught. A
fault swaps an operator or a comparison, changes a number, or leaves out a statement. What cannot change a
result is not drawn: annotations, texts of errors and of the log, code for other systems, seeds of random
numbers. Takes about an hour.
"""

from __future__ import annotations

import argparse
import ast
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
#: Where faults are put -> tests that should notice them. What only a whole scan shows of optics and solver,
#: the figures kept of two scans do.
PLACES = {
    "dsl_core/optics": ("tests/optics", "tests/reconstruction/test_kept_figures.py"),
    "dsl_core/solve": ("tests/solve", "tests/stability", "tests/reconstruction/test_kept_figures.py"),
    "dsl_core/reconstruction": ("tests/reconstruction",),
    "dsl_core/calibration": ("tests/calibration", "tests/campaign/test_kept_figures.py"),
    "dsl_core/capture": ("tests/capture",),
    "dsl_core/io": ("tests/io",),
}
SWAPS: dict[type[ast.AST], str] = {
    ast.Add: "-",
    ast.Sub: "+",
    ast.Mult: "/",
    ast.Div: "*",
    ast.Lt: ">=",
    ast.LtE: ">",
    ast.Gt: "<=",
    ast.GtE: "<",
    ast.Eq: "!=",
    ast.NotEq: "==",
    ast.And: "or",
    ast.Or: "and",
    ast.BitAnd: "|",
    ast.BitOr: "&",
}
LIMIT_S = 1800.0
#: Half as much again of a guard against zero is as good a guard, so numbers below this become one.
TINY = 1e-5
#: Whole numbers up to this become one more, larger ones half as much again, as other numbers do.
SMALL = 9
#: Statements whose absence changes no result.
TALK = ("progress.report(", "_log.", "warnings.")
#: Constants of how much is computed at once, which bounds memory.
AT_ONCE = ("BLOCK", "CHUNK")


@dataclass(frozen=True)
class Fault:
    """One line of a module as it would be with a fault in it."""

    path: str
    line: int
    before: str
    after: str

    def __str__(self) -> str:
        return f"{self.path}:{self.line}: {self.before.strip()}  ->  {self.after.strip()}"


def faults_of(path: str, source: str) -> Iterator[Fault]:
    """Every fault that a module can have on a single line."""
    lines = source.splitlines()

    def on(line: int, start: int, end: int, new: str) -> Fault:
        text = lines[line - 1].encode()
        return Fault(path, line, text.decode(), (text[:start] + new.encode() + text[end:]).decode())

    tree = ast.parse(source)
    silent = {id(part) for root in _without_effect(tree) for part in ast.walk(root)}
    for node in ast.walk(tree):
        if id(node) in silent:
            continue
        match node:
            case (
                ast.BinOp(left=left, op=op, right=right)
                | ast.Compare(left=left, ops=[op], comparators=[right])
            ) if type(op) in SWAPS and left.end_lineno == right.lineno:
                assert left.end_lineno is not None
                assert left.end_col_offset is not None
                between = lines[right.lineno - 1].encode()[left.end_col_offset : right.col_offset]
                if between.strip(b" ()") and b"(" not in between and b")" not in between:
                    yield on(right.lineno, left.end_col_offset, right.col_offset, f" {SWAPS[type(op)]} ")
            case ast.BoolOp(op=op, values=[first, second]) if first.end_lineno == second.lineno:
                assert first.end_col_offset is not None
                between = lines[second.lineno - 1].encode()[first.end_col_offset : second.col_offset]
                if b"(" not in between and b")" not in between:
                    yield on(second.lineno, first.end_col_offset, second.col_offset, f" {SWAPS[type(op)]} ")
            case ast.UnaryOp(op=ast.Not() | ast.USub() as op):
                sign = "not" if isinstance(op, ast.Not) else "-"
                yield on(node.lineno, node.col_offset, node.col_offset + len(sign), "")
            case ast.Constant(value=bool(value)):
                yield on(node.lineno, node.col_offset, node.end_col_offset or 0, str(not value))
            case ast.Constant(value=int(value)):
                new = str(value + 1 if value <= SMALL else value * 3 // 2)
                yield on(node.lineno, node.col_offset, node.end_col_offset or 0, new)
            case ast.Constant(value=float(value)):
                new = repr(1.0 if abs(value) < TINY else value * 1.5)
                yield on(node.lineno, node.col_offset, node.end_col_offset or 0, new)
            case ast.AugAssign() | ast.Expr(value=ast.Call()) if node.lineno == node.end_lineno:
                if lines[node.lineno - 1].strip().startswith(TALK):
                    continue
                yield on(node.lineno, node.col_offset, node.end_col_offset or 0, "pass")


def _without_effect(tree: ast.AST) -> Iterator[ast.AST]:
    """Annotations, decorators, texts of errors and of the log, other systems, `strict`, seeds of chance.

    And how much is computed at once.
    """
    for node in ast.walk(tree):
        match node:
            case ast.Assign(targets=[ast.Name(id=name)]) if name.strip("_") in AT_ONCE:
                yield node.value
        if isinstance(node, ast.If) and (here := _is_here(node.test)) is not None:
            yield from node.orelse if here else node.body
        if isinstance(node, ast.Raise) and node.exc is not None:
            yield node.exc
        if isinstance(node, ast.Expr) and ast.unparse(node).startswith(("_log.", "warnings.")):
            yield node
        if isinstance(node, ast.arg | ast.AnnAssign) and node.annotation is not None:
            yield node.annotation
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield from node.decorator_list
        if isinstance(node, ast.FunctionDef) and node.returns is not None:
            yield node.returns
        if isinstance(node, ast.Call) and ast.unparse(node.func).endswith("default_rng"):
            yield from node.args
        # Other systems alone have folders by the author of a program.
        if isinstance(node, ast.keyword) and node.arg in ("strict", "appauthor"):
            yield node.value


def _is_here(test: ast.expr) -> bool | None:
    """Whether a condition that asks for the operating system holds on this one; None for any other."""
    match test:
        case ast.Compare(left=asked, ops=[ast.Eq()], comparators=[ast.Constant(value=str(name))]):
            known = {"sys.platform": sys.platform, "os.name": os.name}.get(ast.unparse(asked))
            return None if known is None else known == name
    return None


def draw(count: int, seed: int) -> list[Fault]:
    """Faults from all places in equal numbers, modules weighted by how many faults they can have."""
    chance = random.Random(seed)
    drawn: list[Fault] = []
    for i, place in enumerate(PLACES):
        modules = sorted((ROOT / place).rglob("*.py"))
        possible = [
            fault
            for module in modules
            for fault in faults_of(module.relative_to(ROOT).as_posix(), module.read_text(encoding="utf-8"))
            if fault.before != fault.after
        ]
        many = (count * (i + 1)) // len(PLACES) - (count * i) // len(PLACES)
        drawn += chance.sample(possible, many)
    return drawn


def place_of(fault: Fault) -> str:
    """The key of `PLACES` that a fault belongs to."""
    return next(place for place in PLACES if fault.path.startswith(place + "/"))


def tests_of(fault: Fault) -> list[str]:
    """All test files of a fault's folder: first that of its module, those that import it, those beside it."""
    place = place_of(fault)
    module = Path(fault.path)
    inner = module.parent.relative_to(place).parts
    dotted = ".".join(module.with_suffix("").parts)

    def distance(test: Path) -> tuple[bool, bool, bool]:
        named = test.stem == f"test_{module.stem}"
        imports = f"from {dotted} import" in test.read_text(encoding="utf-8")
        return (not named, not imports, not (inner and inner[0] in test.parts))

    found = [path for name in PLACES[place] for path in files_of(ROOT / name)]
    return [path.relative_to(ROOT).as_posix() for path in sorted(found, key=distance)]


def files_of(tests: Path) -> list[Path]:
    """Test files of a folder; a file alone."""
    return [tests] if tests.is_file() else sorted(tests.rglob("test_*.py"))


def is_caught(fault: Fault, tree: Path) -> bool | None:
    """Whether the tests fail with the fault in a copy of the tree; None where they took too long."""
    target = tree / fault.path
    sound = target.read_text(encoding="utf-8")
    lines = sound.splitlines(keepends=True)
    lines[fault.line - 1] = fault.after + "\n"
    target.write_text("".join(lines), encoding="utf-8")
    try:
        return not pass_in(tree, tests_of(fault))
    except subprocess.TimeoutExpired:
        return None
    finally:
        target.write_text(sound, encoding="utf-8")


def pass_in(tree: Path, tests: Sequence[str]) -> bool:
    """Whether tests pass in a copy of the tree; raises ``TimeoutExpired`` where they take too long."""
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "-n", "0"]
    environment = {
        **os.environ,
        "PYTHONPATH": f"{tree}{os.pathsep}{tree / 'app'}",
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    done = subprocess.run(
        [*command, *tests], cwd=tree, env=environment, capture_output=True, timeout=LIMIT_S, check=False
    )
    return done.returncode == 0


def main() -> None:
    """Draw faults, try each, and say which the tests caught."""
    parser = argparse.ArgumentParser(description="Faults that the tests should notice.")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--part", default="1/1", help="which share to run, such as 1/2 beside 2/2")
    parser.add_argument("--sound", action="store_true", help="the whole suite has just passed on this tree")
    parser.add_argument("--list", action="store_true", help="only list the faults")
    asked = parser.parse_args()
    part, parts = (int(number) for number in asked.part.split("/"))
    faults = draw(asked.count, asked.seed)[part - 1 :: parts]
    if asked.list:
        print(*faults, sep="\n")
        return
    survived: list[Fault] = []
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        hidden = shutil.ignore_patterns(".git", ".venv", "__pycache__", ".*_cache", "dsl-demo*")
        shutil.copytree(ROOT, tree, ignore=hidden)
        for place in dict.fromkeys(map(place_of, faults)):
            if not (asked.sound or pass_in(tree, PLACES[place])):
                raise SystemExit(f"The tests of {place} fail without a fault; nothing can be said of them.")
        for number, fault in enumerate(faults, 1):
            start = time.monotonic()
            caught = is_caught(fault, tree)
            said = {True: "caught", False: "SURVIVED", None: "caught (no end)"}[caught]
            print(f"{number:3d} {said:16s} {time.monotonic() - start:5.0f} s  {fault}", flush=True)
            if caught is False:
                survived.append(fault)
    print(f"{len(faults) - len(survived)} of {len(faults)} faults caught, {len(survived)} survived")
    print(*survived, sep="\n")


if __name__ == "__main__":
    main()

"""Write again what the README shows of the program's output: ``python packaging/outputs.py``.

With ``--check`` nothing is written; the exit code is 1 where what is shown no longer holds. A block belongs
to the comment before it, which names its command. Needs the environment of the program, and two minutes.
"""

from __future__ import annotations

import argparse
import re
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

README = Path(__file__).resolve().parents[1] / "README.md"
#: What has to run before a command whose output is shown.
BEFORE = {
    "dsl-scan demo": (),
    "dsl-scan evaluate small.zarr": ("dsl-scan plan", "dsl-scan scan", "dsl-scan reconstruct"),
}
#: A figure may differ by this share of itself or of its deviation, whichever is more: machines differ. A
#: deviation, which has two digits, may by this one.
TOLERANCE, OF_DEVIATION, DEVIATION = 0.02, 0.5, 0.06
_BLOCK = re.compile(r"<!-- printed by: (.*?) -->\n\n```\n(.*?)```", re.DOTALL)
_NUMBER = re.compile(r"[+-]?\d+\.?\d*(?:e[+-]\d+)?")


def shown(text: str) -> dict[str, list[str]]:
    """Lines that a page shows, by the command that prints them."""
    return {command: block.splitlines() for command, block in _BLOCK.findall(text)}


def differences(lines: list[str], printed: list[str]) -> list[str]:
    """Lines shown that are not printed in this order, but for figures within the tolerance.

    ``...`` stands for lines that are left out; without it nothing may be printed between two lines shown.
    """
    wrong, position, skipped = [], 0, True
    for line in lines:
        if line.strip() == "...":
            skipped = True
            continue
        where = next((i for i in range(position, len(printed)) if _alike(line, printed[i])), None)
        if where is None or (where > position and not skipped):
            near = printed[position] if position < len(printed) else "nothing"
            wrong.append(f"shown: {line.rstrip()}; printed: {near.rstrip()}")
            position += 1
        else:
            position = where + 1
        skipped = False
    return wrong


def _alike(one: str, other: str) -> bool:
    words = [re.sub(r"\s+", " ", _NUMBER.sub("#", text)).strip() for text in (one, other)]
    if words[0] != words[1]:
        return False
    pairs = zip(_figures(one), _figures(other), strict=True)
    return all(abs(a - b) <= slack for (a, slack), (b, _) in pairs)


def _figures(line: str) -> list[tuple[float, float]]:
    """The numbers of a line, each with what it may differ by."""
    numbers = [float(found) for found in _NUMBER.findall(line)]
    slack = [TOLERANCE * abs(number) for number in numbers]
    if "±" in line and len(numbers) > 1:
        slack[:2] = max(slack[0], OF_DEVIATION * numbers[1]), DEVIATION * numbers[1]
    return list(zip(numbers, slack, strict=True))


def excerpt(lines: list[str], printed: list[str]) -> list[str]:
    """The lines shown, as they are printed now; one that no longer is stays, to be seen."""
    names = {re.split(r"\s{2,}", line)[0]: line.rstrip() for line in printed}
    return [names.get(re.split(r"\s{2,}", line)[0], line) for line in lines]


def run(command: str, text: str, folder: Path) -> list[str]:
    """Run a command of a page, after those that it needs; returns its lines."""
    known = [line.split(" # ")[0].strip() for line in text.splitlines() if line.startswith("dsl-scan ")]
    first = [next(line for line in known if line.startswith(start)) for start in BEFORE[command]]
    answer = ""
    for line in (*first, command):
        words = [sys.executable, "-m", "dsl_core", *shlex.split(line)[1:]]
        answer = subprocess.run(words, cwd=folder, check=True, stdout=subprocess.PIPE, text=True).stdout
    return answer.splitlines()


def main() -> int:
    """Run every command whose output is shown; write it, or compare."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="compare, and write nothing")
    checks = parser.parse_args().check
    text, code = README.read_text(encoding="utf-8"), 0
    for command, lines in shown(text).items():
        with tempfile.TemporaryDirectory() as folder:
            printed = run(command, text, Path(folder))
        if checks:
            wrong = differences(lines, printed)
            print(*(wrong or [f"{command}: as shown"]), sep="\n")
            code = max(code, int(bool(wrong)))
        else:
            head = f"<!-- printed by: {command} -->\n\n```\n"
            old, new = ("\n".join(part) for part in (lines, excerpt(lines, printed)))
            text = text.replace(f"{head}{old}\n", f"{head}{new}\n")
    if not checks:
        README.write_text(text, encoding="utf-8")
    return code


if __name__ == "__main__":
    sys.exit(main())

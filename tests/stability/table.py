"""The table of hard cases with their outcomes in both precisions, as Markdown.

``python -m tests.stability.table`` runs them all; 1 where a case does not end as it should.
"""

from __future__ import annotations

import re

import torch

from tests.stability.case import PRECISIONS, Case, Outcome
from tests.stability.catalogue import PARTS


def as_wanted(case: Case, outcome: Outcome) -> bool:
    """Whether a case ended as it should and said what it should."""
    return outcome.ending == case.ends and re.search(case.says, outcome.says) is not None


def main() -> int:
    """Print the table."""
    torch.set_num_threads(1)
    wrong = 0
    print("| part | case | what is hard | wanted | single | double |\n|---|---|---|---|---|---|")
    for part, cases in PARTS.items():
        for case in cases:
            cells = []
            for dtype in PRECISIONS.values():
                outcome = case.outcome(dtype)
                good = as_wanted(case, outcome)
                wrong += not good
                cells.append(f"{'' if good else '**not so** '}{outcome.ending}: {outcome.says}")
            wanted = f"{case.ends} {case.says.replace('|', ' or ')}".strip()
            print(f"| {part} | {case.name} | {case.hard} | {wanted} | {' | '.join(cells)} |", flush=True)
    return int(wrong > 0)


if __name__ == "__main__":
    raise SystemExit(main())

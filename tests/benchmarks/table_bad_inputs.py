"""The table of bad calibration inputs: what happened, where it was detected, and what the command told.

``python -m tests.benchmarks.table_bad_inputs [CAMPAIGN]`` calibrates a small twin (into CAMPAIGN, to be used
again) by ``dsl-scan calibrate all``, lets each mishap happen to a copy, and prints what the commands say.
"""

from __future__ import annotations

import re
import sys
import tempfile
from pathlib import Path

from tests.cases.bad_calibration_inputs import CASES, run_case
from tests.cases.tiny_campaign import command_all, give


def main() -> int:
    """Print the table; 1 when a mishap was not told, or changed what it must not."""
    wrong = 0
    with tempfile.TemporaryDirectory(prefix="dsl-bad-inputs-") as spare:
        calibrated = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(spare) / "calibrated"
        ending = give(*command_all(calibrated))
        if ending.code:
            print(ending.err, file=sys.stderr)
            return ending.code
        print("| case | detected at | ends with | message | earlier files |\n|---|---|---|---|---|")
        for number, case in enumerate(CASES):
            told = run_case(case, calibrated, Path(spare) / f"{number}" / "campaign")
            found = re.search(rf"[^\n]*(?:{case.told})[^\n]*", told.message)
            message = found[0].strip() if found else f"NOT TOLD: {told.message[-300:]}"
            kept = "unchanged" if not told.changed else f"CHANGED: {', '.join(told.changed)}"
            wrong += not found or bool(told.changed) or told.code != case.code
            print(f"| {case.name} | {case.detected_at} | {told.code} | {message} | {kept} |", flush=True)
    return int(wrong > 0)


if __name__ == "__main__":
    raise SystemExit(main())

"""Give every wrong command line, and print code, CPU seconds and sentence: ``python -m ... FOLDER``.

The last line counts what is not as promised: exit code 2, one sentence, no words of libraries, at once, and
nothing changed.
"""

from __future__ import annotations

import contextlib
import io
import os
import sys
import time
from pathlib import Path

from dsl_core.cli import main as give
from tests.cases.wrong_lines import wrong_lines
from tests.system.conftest import Ending
from tests.system.test_cli_wrong_lines import contents, faults_of, make_desk

#: CPU seconds; what computes takes longer.
AT_ONCE_S = 3.0


def main() -> None:
    """Make the files, give the lines, count."""
    home = Path(sys.argv[1])
    home.mkdir(parents=True)
    os.chdir(home)
    os.environ["XDG_DATA_HOME"] = str(home.absolute().with_name("data-of-wrong-lines"))
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM"):
        os.environ.pop(name, None)
    small = ("-O size=56x36", "--code columns --lines 8x8 --setting 333.3@0.8")
    assert give(f"scan scan.dsl {' '.join(small)}".split()) == 0
    assert give(["reconstruct", "scan.dsl", "--bands", "430:660:46"]) == 0
    make_desk(home)
    before, bad, longest = contents(home), 0, 0.0
    for name, line in wrong_lines():
        out, err = io.StringIO(), io.StringIO()
        sys.stdin = io.StringIO()
        start_s = time.process_time()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            code = give(line)
        seconds = time.process_time() - start_s
        longest = max(longest, seconds)
        faults = faults_of(Ending(code, out.getvalue(), err.getvalue()))
        faults += f" {seconds:.1f} s" if seconds > AT_ONCE_S else ""
        if contents(home) != before:
            faults, before = f"{faults} changed files", contents(home)
        bad += bool(faults)
        told = f"WRONG: {faults}" if faults else ""
        print(f"{code} {seconds:4.1f} s {told}  {name}: {err.getvalue().strip()}")
    print(f"{len(wrong_lines())} lines, {bad} not as promised, the longest {longest:.1f} s of CPU time")


if __name__ == "__main__":
    main()

"""``dsl-scan``: a thin command for each function of the pipeline.

Figures and findings go to standard output, progress and errors to standard error. Exit codes: 0
success, 1 a bug, 2 wrong input (one sentence says what to do), 130 stopped by the user.
"""

from __future__ import annotations

import codecs
import gc
import io
import os
import sys
from collections.abc import Sequence

#: Packages bring a million objects that stay. Looking through them as often as Python does by itself takes a
#: tenth of the time of a short command.
_COLLECTION = (50_000, 20, 50)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line (that of the process if not given) and return its exit code."""
    gc.set_threshold(*_COLLECTION)
    _open_missing_streams()
    _say_what_the_stream_can()
    try:
        # Inside, so that Ctrl-C while it loads ends in a sentence as well.
        from dsl_core.solve.heap import keep_freed_memory
        from dsl_core.solve.threads import share_no_small_matrices

        share_no_small_matrices()
        keep_freed_memory()
        from dsl_core.cli.run import run

        return run(list(sys.argv[1:] if arguments is None else arguments))
    except KeyboardInterrupt:
        print("Stopped before anything was done.", file=sys.stderr)
        return 130


def _open_missing_streams() -> None:
    """Replace standard streams that are closed, as services and jobs may have them, by ones for nothing."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115 - for the whole process


def _say_what_the_stream_can() -> None:
    """Let a letter that a pipe or file cannot take, as Greek ones on Windows, become a question mark."""
    stream = sys.stdout
    if isinstance(stream, io.TextIOWrapper) and codecs.lookup(stream.encoding).name != "utf-8":
        stream.reconfigure(errors="replace")

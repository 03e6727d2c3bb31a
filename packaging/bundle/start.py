"""Start of the bundled program: the command line, the window, or one of its helper programs by ``-m``.

Packages in the folder ``drivers`` beside the program, and in that of the user, are found as if they were
installed: ``pip install --target drivers my-lab``.
"""

from __future__ import annotations

import multiprocessing
import runpy
import sys
from pathlib import Path


def driver_folders() -> list[Path]:
    """Where packages of other people may be."""
    from platformdirs import user_data_path

    return [Path(sys.executable).resolve().parent / "drivers", user_data_path("dsl-scan") / "drivers"]


def main() -> int:
    """Run what the program's name and first argument ask for; returns the exit code."""
    multiprocessing.freeze_support()
    sys.path += [str(folder) for folder in driver_folders() if folder.is_dir()]
    if sys.argv[1:2] == ["-m"]:
        name = sys.argv[2]
        sys.argv = sys.argv[2:]
        runpy.run_module(name, run_name="__main__", alter_sys=True)
        return 0
    if Path(sys.executable).stem == "dsl-scan-gui":
        from dsl_app.__main__ import main as window

        return window()
    from dsl_core.cli import main as command

    return command()


if __name__ == "__main__":
    sys.exit(main())

"""``python -m dsl_core.cli`` is ``dsl-scan`` without an installation."""

import sys

from dsl_core.cli import main

if __name__ == "__main__":
    sys.exit(main())

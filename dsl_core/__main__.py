"""``python -m dsl_core`` is ``dsl-scan``, wherever that is not on the path."""

import sys

from dsl_core.cli import main

if __name__ == "__main__":
    sys.exit(main())

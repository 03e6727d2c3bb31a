"""What scripts use: functions over paths and plain values, and the accessor of results."""

import os

#: What names a file or folder.
FilePath = str | os.PathLike[str]

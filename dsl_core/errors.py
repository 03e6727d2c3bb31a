"""The few exceptions a user meets.

Each message says what was given, what was wanted and what to do next. The command line turns every
one of them into a single sentence and exit code 2.
"""


class DslError(Exception):
    """Base of all errors with a message written for the person at the instrument."""


class DeviceError(DslError):
    """A camera, projector, stage or spectroradiometer did not do what it was asked."""


class DriftError(DeviceError):
    """Every device answers, but scene, rig or light are not as they were when a scan stopped."""


class CalibrationError(DslError):
    """A calibration is missing, damaged, or does not belong to the data."""


class DecodeError(DslError):
    """Captured frames cannot be turned into columns, depth or spectra."""


class PlanError(DslError):
    """A capture plan is impossible on this rig or contradicts itself."""


class StoreError(DslError):
    """A scan, result or export on disk cannot be read or written."""


class DriveError(StoreError):
    """A drive does not answer, or refuses a file; nothing is known to be wrong with what is on it."""


class TakenError(StoreError):
    """What is to be written exists already; it may be replaced where that was allowed."""


class MissingPackageError(DslError):
    """The work needs a package that belongs to an extra, which was not installed."""


class Cancelled(DslError):
    """The user stopped the work; everything finished so far is kept."""

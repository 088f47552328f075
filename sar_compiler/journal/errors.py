"""The exceptions that functions of this package raise about journals."""

from sar_compiler.errors import SarError


class JournalError(SarError):
    """A journal cannot be used, or must not be used as requested.

    The refused request has not moved the robot.
    """


class JournalPlaceError(JournalError):
    """The file of a journal cannot be created, opened or moved at its path."""

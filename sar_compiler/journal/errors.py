"""What can be wrong with a journal."""

from sar_compiler.errors import SarError


class JournalError(SarError):
    """A journal cannot be used, or is not to be used in this way; nothing has moved."""


class JournalPlaceError(JournalError):
    """The file of a journal cannot be made, opened or moved where it is."""

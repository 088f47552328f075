"""The root of what this project raises for its users.

Every module that raises defines its own errors on top of :class:`SarError`; the commands show any
of them as a message, without a traceback.
"""


class SarError(Exception):
    """Something a user did, wrote or lacks; the text says what it is and what to do."""


class UndecidableError(SarError):
    """The runs of a tree cannot be searched."""

"""The root of what this project raises for its users.

Every module that raises defines its own errors on top of :class:`SarError`; the commands show any
of them as a message, without a traceback.
"""


class SarError(Exception):
    """Something a user did, wrote or lacks; the text says what it is and what to do.

    Attributes:
        exit_status: The status with which a command ends for it.
    """

    exit_status = 2


class UndecidableError(SarError):
    """The runs of a tree cannot be searched."""


class UnsteadyError(UndecidableError):
    """The same tick, played twice with the same choices, did not ask the same questions."""


class NodeError(SarError):
    """A node cannot go on.

    Attributes:
        node: Its name; empty where that is not known.
    """

    def __init__(self, message: str, node: str = "") -> None:
        super().__init__(message)
        self.node = node

"""The base classes of the errors that this project reports to users.

Every module derives its own errors from `SarError`. A command prints such an error as a message, without a traceback.
"""


class SarError(Exception):
    """An error caused by the user's input or environment. Its message names the problem and the remedy.

    Attributes:
        exit_status: The exit status of a command that ends with this error.
    """

    exit_status = 2


class UndecidableError(SarError):
    """The runs of a tree cannot be searched."""


class UnsteadyError(UndecidableError):
    """A tick was repeated with the same choices, but requested other choices than before."""


class NodeError(SarError):
    """A node cannot continue.

    Attributes:
        node: The node's name; empty if the name is unknown.
    """

    def __init__(self, message: str, node: str = "") -> None:
        super().__init__(message)
        self.node = node

"""Clean-up when the leaves of a tree cannot be set up."""

from itertools import takewhile
from typing import NoReturn

from py_trees.behaviour import Behaviour
from rclpy.node import Node

from sar_compiler.errors import SarError
from sar_compiler.ros.failure_reports import called_by_engine, described, named, places, raised_in
from sar_compiler.ros.stopping import shut_down, stop_leaves


class SetupFailedError(SarError, RuntimeError):
    """The setup of a leaf raised an exception.

    Attributes:
        behaviour: The leaf's name.
    """

    def __init__(self, behaviour: Behaviour, error: Exception) -> None:
        self.behaviour = behaviour.name
        super().__init__(f"{named(behaviour)} failed in setup: {described(error)}{places(behaviour, error)}")


def give_up(root: Behaviour, error: Exception, node: Node) -> NoReturn:
    """Stop and shut down the behaviours that are set up already, and raise the error of the setup.

    Raises:
        SetupFailedError: If it was raised by a behaviour's setup.
        Exception: The original exception, if it needs no context (a `SarError`) or was raised elsewhere.
    """
    called = called_by_engine(error)
    ready = list(takewhile(lambda behaviour: behaviour is not called, root.iterate()))
    stop_leaves(ready, node)
    shut_down(ready, node)
    behaviour = raised_in(error)
    if behaviour is None or isinstance(error, SarError):
        raise error
    raise SetupFailedError(behaviour, error) from error

"""Runs that are started for others: what their server asks of who starts them, and what comes with a goal."""

import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Literal, NamedTuple, NoReturn, Protocol

from sar_compiler.errors import SarError

if TYPE_CHECKING:
    from rclpy.node import Node


# How many names of a parameter stand below each other, at most.
_DEEPEST = 20
# How a parameter is called, with those above it before dots.
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*(?:\.[A-Za-z0-9_]+)*")
_SHOWN = 60


class PayloadError(SarError):
    """What comes with a goal cannot be understood."""


class EndedRun(NamedTuple):
    """How a run has ended.

    Attributes:
        outcome: What the tree has come to; IDLE if it has not begun, or was stopped.
        message: What is said of it: of a complete one its summary, else the reason.
    """

    outcome: Literal["IDLE", "SUCCESS", "FAILURE"]
    message: str


class ServedRun(Protocol):
    """A run that was started."""

    def stop(self) -> None:
        """Have it end in order; called again, at once."""

    def hold(self, *, wanted: bool, refused: Callable[[str], None]) -> None:
        """Have its robot stand until that is not wanted any more.

        Args:
            wanted: Whether it is wanted.
            refused: Is told why, from any thread, if that is not carried out.
        """


class RunStarter(Protocol):
    """Starts runs.

    Attributes:
        node: The node that serves, of which orders come.
    """

    node: "Node"

    def trees(self) -> Sequence[str]:
        """Read all trees anew, and return their names.

        Raises:
            SarError: If one of them cannot be flown.
        """

    def why_not(self, tree: str, parameters: Mapping[str, object]) -> str:
        """Return why a run of a tree cannot be started with some parameters; empty if it can."""

    def start(
        self,
        tree: str,
        parameters: Mapping[str, object],
        tell: Callable[[str], None],
        end: Callable[[EndedRun], None],
    ) -> ServedRun:
        """Start a run.

        Args:
            tree: The name of its tree.
            parameters: Parameters of its mission, by their full names.
            tell: Is told what happens, from any thread.
            end: Is told how it has ended, once, from any thread.
        """


def parameters_of(payload: str) -> Mapping[str, object]:
    """Return the parameters that the payload of a goal names, by their full names: `{"speed": {"limit": 0.5}}` has `speed.limit`.

    Args:
        payload: A JSON object; empty for none.

    Raises:
        PayloadError: If it is none.
    """
    if not payload.strip():
        return {}
    try:
        found = json.loads(payload, parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as error:
        raise PayloadError(f"the payload is no JSON: {error}") from error
    if not isinstance(found, dict):
        raise PayloadError(
            'the payload is a JSON object with parameters of the mission, such as {"tick_rate_hz": 4.0}'
        )
    return dict(_flat(found, "", _DEEPEST))


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is no number of JSON")


def _flat(found: Mapping[str, object], before: str, levels: int) -> Iterator[tuple[str, object]]:
    if not levels:
        raise PayloadError("the payload is nested too deeply for parameters")
    for name, value in found.items():
        # ROS would take `node:name` for a parameter of another node.
        if not _NAME.fullmatch(name):
            raise PayloadError(
                f"the payload names a parameter {name[:_SHOWN]!r}: a name has letters, digits and _ alone"
            )
        if isinstance(value, dict):
            yield from _flat(value, f"{before}{name}.", levels - 1)
        else:
            yield f"{before}{name}", _as_one_type(value)


def _as_one_type(value: object) -> object:
    """Return a list of whole and other numbers as real ones: JSON knows no difference, and ROS takes no list of both."""
    if not isinstance(value, list) or {type(each) for each in value} != {int, float}:
        return value
    try:
        return [float(each) for each in value]
    except OverflowError:
        raise PayloadError("the payload has a number that is too large") from None

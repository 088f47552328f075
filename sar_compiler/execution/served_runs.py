"""Interface between the tree server and the code that starts runs, and the payload of goals."""

import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Literal, NamedTuple, NoReturn, Protocol

from sar_compiler.errors import SarError

if TYPE_CHECKING:
    from rclpy.node import Node


# Largest nesting of a parameter's names.
_DEEPEST = 20
# The name of a parameter, with its parents before dots.
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*(?:\.[A-Za-z0-9_]+)*")
_SHOWN = 60


class PayloadError(SarError):
    """The payload of a goal is invalid."""


class EndedRun(NamedTuple):
    """The outcome of a run.

    Attributes:
        outcome: The status of the tree; IDLE if the run has not started, or was stopped.
        message: The summary of a complete run, otherwise the reason.
    """

    outcome: Literal["IDLE", "SUCCESS", "FAILURE"]
    message: str


class ServedRun(Protocol):
    """A started run."""

    def stop(self) -> None:
        """Stop gracefully; a second call stops immediately."""

    def hold(self, *, wanted: bool, refused: Callable[[str], None]) -> None:
        """Pause the robot, or resume.

        Args:
            wanted: True to pause, False to resume.
            refused: Called with the reason, from any thread, if the mission refuses.
        """


class RunStarter(Protocol):
    """Starts runs.

    Attributes:
        node: The server's node, which receives goals.
    """

    node: "Node"

    def read_tree_ids(self) -> Sequence[str]:
        """Read all trees again, and return their names.

        Raises:
            SarError: If a tree cannot be run.
        """

    def refusal_reason(self, tree: str, parameters: Mapping[str, object]) -> str:
        """Return why a run of a tree cannot be started with some parameters; empty if it can be."""

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
            tell: Called with its events, from any thread.
            end: Called once with its outcome, from any thread.
        """


def parameters_of(payload: str) -> Mapping[str, object]:
    """Return the parameters of a goal's payload by full name: `{"speed": {"limit": 0.5}}` has `speed.limit`.

    Args:
        payload: A JSON object; empty for none.

    Raises:
        PayloadError: If it is invalid.
    """
    if not payload.strip():
        return {}
    try:
        found = json.loads(payload, parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as error:
        raise PayloadError(f"the payload is not JSON: {error}") from error
    if not isinstance(found, dict):
        raise PayloadError(
            'the payload must be a JSON object with parameters of the mission, such as {"tick_rate_hz": 4.0}'
        )
    return dict(_flatten(found, "", _DEEPEST))


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a JSON number")


def _flatten(found: Mapping[str, object], before: str, levels: int) -> Iterator[tuple[str, object]]:
    if not levels:
        raise PayloadError("the payload is nested too deeply for parameters")
    for name, value in found.items():
        # ROS would read `node:name` as a parameter of another node.
        if not _NAME.fullmatch(name):
            raise PayloadError(
                f"the payload has a parameter {name[:_SHOWN]!r}: use letters, digits and _ in names"
            )
        if isinstance(value, dict):
            yield from _flatten(value, f"{before}{name}.", levels - 1)
        else:
            yield f"{before}{name}", _as_one_type(value)


def _as_one_type(value: object) -> object:
    """Convert a list that mixes integers and real numbers to real numbers, because ROS rejects a mixed list."""
    if not isinstance(value, list) or {type(each) for each in value} != {int, float}:
        return value
    try:
        return [float(each) for each in value]
    except OverflowError:
        raise PayloadError("the payload has a number that is too large") from None

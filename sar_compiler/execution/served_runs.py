"""The interface between the tree server and the code that starts runs, and the parser of goal payloads."""

import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Literal, NamedTuple, NoReturn, Protocol

from sar_compiler.errors import SarError

if TYPE_CHECKING:
    from rclpy.node import Node


# Maximum nesting depth of parameters in a payload.
_DEEPEST = 20
# A parameter name, which may include group names: `group.name`.
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*(?:\.[A-Za-z0-9_]+)*")
# Maximum length of an invalid name in a message, in characters.
_SHOWN = 60


class PayloadError(SarError):
    """Raised if the payload of a goal is invalid."""


class EndedRun(NamedTuple):
    """The outcome of a run.

    Attributes:
        outcome: SUCCESS or FAILURE for a finished mission; IDLE if the run did not start or was stopped.
        message: The JSON summary of a successful run, otherwise the reason why the run ended.
    """

    outcome: Literal["IDLE", "SUCCESS", "FAILURE"]
    message: str


class ServedRun(Protocol):
    """A run that was started for a client."""

    def stop(self) -> None:
        """Stop the run gracefully; a second call stops it immediately."""

    def hold(self, *, wanted: bool, refused: Callable[[str], None]) -> None:
        """Pause or resume the mission.

        Args:
            wanted: True to pause, False to resume.
            refused: Called with the reason, from any thread, if the mission refuses.
        """


class RunStarter(Protocol):
    """Starts runs of the served trees.

    Attributes:
        node: The server's node, which receives goals.
    """

    node: "Node"

    def read_tree_ids(self) -> Sequence[str]:
        """Read all tree files again, and return the IDs of the trees.

        Raises:
            SarError: If a tree cannot be run.
        """

    def refusal_reason(self, tree: str, parameters: Mapping[str, object]) -> str:
        """Return why no run of the tree can start with the parameters, or an empty string if a run can start."""

    def start(
        self,
        tree: str,
        parameters: Mapping[str, object],
        tell: Callable[[str], None],
        end: Callable[[EndedRun], None],
    ) -> ServedRun:
        """Start a run.

        Args:
            tree: The ID of the tree.
            parameters: The values of mission parameters by full name.
            tell: Called with each message of the run, from any thread.
            end: Called once with the outcome of the run, from any thread.
        """


def parameters_of(payload: str) -> Mapping[str, object]:
    """Return the parameters in a goal's payload, as a mapping from full name to value.

    For example, `{"speed": {"limit": 0.5}}` sets `speed.limit`.

    Args:
        payload: A JSON object, or an empty string.

    Raises:
        PayloadError: If the payload is invalid.
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
        raise PayloadError("the payload is nested too deeply: it cannot be converted to parameters")
    for name, value in found.items():
        # ROS would read `node:name` as a parameter of another node.
        if not _NAME.fullmatch(name):
            raise PayloadError(
                f"the payload has an invalid parameter name {name[:_SHOWN]!r}. Use only letters, digits and _ in names"
            )
        if isinstance(value, dict):
            yield from _flatten(value, f"{before}{name}.", levels - 1)
        else:
            yield f"{before}{name}", _as_one_type(value)


def _as_one_type(value: object) -> object:
    """Convert a list that mixes integers and real numbers to real numbers, because ROS rejects mixed lists."""
    if not isinstance(value, list) or {type(each) for each in value} != {int, float}:
        return value
    try:
        return [float(each) for each in value]
    except OverflowError:
        raise PayloadError("the payload has a number that is too large") from None

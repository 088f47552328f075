"""Fault injection: the faults given by `--fault`, and a service server that can produce them.

The parsing and the bookkeeping are plain Python; only :func:`create_service` touches ROS.
"""

import math
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

from sar_compiler.errors import SarError
from sar_compiler.tree.guessing import did_you_mean, nearest

if TYPE_CHECKING:
    from rclpy.node import Node
    from rclpy.service import Service

NAVIGATION, LOCALISATION = "navigate_to_pose", "amcl"
NAVIGATION_FAULTS = {
    NAVIGATION: ("abort", "code", "late", "starved", "succeed", "delay", "reject", "die"),
    LOCALISATION: ("die",),
}
"""The faults of the Nav2 substitute, the same for every mission."""


class _FaultForm(NamedTuple):
    """The syntax of a kind of fault.

    Attributes:
        text: The syntax, in words.
        parts: The parts after the kind: none, `=` and a value, `@` and a location, or both.
        amount: The attribute that the value sets; empty if there is none.
        option: The option after the comma, seconds; empty if there is none.
    """

    text: str
    parts: tuple[str, ...] = ("=",)
    amount: str = ""
    option: str = ""


_FORMS = {
    "drop": _FaultForm("drop=COUNT", amount="count"),
    "delay": _FaultForm("delay=SECONDS", amount="seconds"),
    "refuse": _FaultForm("refuse=COUNT", amount="count"),
    "abort": _FaultForm("abort=PLACE", amount="place"),
    "code": _FaultForm("code=NUMBER[@PLACE][,after=SECONDS]", ("=", "=@"), "code", "after"),
    "late": _FaultForm("late=SECONDS[@PLACE][,drives=SECONDS]", ("=", "=@"), "seconds", "drives"),
    "starved": _FaultForm("starved[@PLACE]", ("", "@")),
    "succeed": _FaultForm("succeed[@PLACE]", ("", "@")),
    "reject": _FaultForm("reject=COUNT", amount="count"),
    "die": _FaultForm("die[@PLACE][,back=SECONDS]", ("", "@"), option="back"),
}
_SHAPE = re.compile(r"(\w*)(?:=([^@,]*))?(?:@([^,]*))?(?:,([^=]*)=?(.*))?", re.DOTALL)


class FaultError(SarError):
    """A fault is invalid.

    Attributes:
        spec: The fault as written.
        problem: The error in it.
    """

    def __init__(self, spec: str, problem: str) -> None:
        self.spec, self.problem = spec, problem
        super().__init__(f"fault '{spec}': {problem}")


@dataclass(frozen=True)
class Fault:
    """A fault of a simulated server.

    Attributes:
        target: The service or action, such as `navigate_to_pose`, or the node `amcl`.
        kind: `drop`, `delay`, `refuse`, `abort`, `code`, `late`, `starved`, `succeed`, `reject` or `die`.
        count: The number of calls or goals that it affects (`drop`, `refuse`, `reject`).
        seconds: Seconds of the server's clock: the delay of each response (`delay`), the drive before the end (`code`), or the delay until a
                server of Nav2 acknowledges another server's goal (`late`).
        place: The location that it affects (`abort`, `code`, `late`, `starved`, `succeed`, `die`); "" for all.
        code: The error code that a goal ends with (`code`).
        drives: How long the robot continues to drive after the end of a goal, seconds of the server's clock (`late`).
        back: The time until a crashed server returns, in simulated seconds; None for never (`die`).
        text: The fault as written.
    """

    target: str
    kind: str
    count: int = 0
    seconds: float = 0.0
    place: str = ""
    code: int = 0
    drives: float = 1.0
    back: float | None = None
    text: str = field(default="", compare=False)

    def __str__(self) -> str:
        return self.text


def parse_fault(text: str, targets: Mapping[str, Collection[str]]) -> Fault:
    """Parse one fault, for instance `take_photo:drop=2` or `navigate_to_pose:die@yard,back=5`.

    Args:
        text: The fault as written.
        targets: The possible faults by service or action.

    Raises:
        FaultError: If it is invalid; the message lists the valid forms.
    """
    target, colon, rest = text.strip().partition(":")
    _require_among(text, "target", target, targets)
    if not colon or not rest:
        allowed = ", ".join(f"{target}:{_FORMS[kind].text}" for kind in targets[target])
        raise FaultError(text, f"has no kind of fault: write one of {allowed}")
    match = _SHAPE.fullmatch(rest)
    kind, value, place, option, seconds = match.groups() if match else ("", None, None, None, "")
    _require_among(text, f"fault of {target}", kind, targets[target])
    form = _FORMS[kind]
    parts = f"{'=' if value is not None else ''}{'@' if place is not None else ''}"
    if parts not in form.parts or "" in {value, place}:
        raise FaultError(text, f"expected {target}:{form.text}")
    if option is not None and option != form.option:
        raise FaultError(text, f"unknown option '{option}={seconds}': expected {target}:{form.text}")
    fault = Fault(target, kind, text=text)
    if value is not None:
        fault = replace(fault, **{form.amount: _AMOUNTS[form.amount](text, value)})
    if place is not None:
        fault = replace(fault, place=_check_place(text, place))
    if option is None:
        return fault
    given: dict[str, Any] = {_OPTIONS.get(form.option, form.option): _seconds(text, seconds)}
    return replace(fault, **given)


@dataclass(frozen=True)
class CallFaults:
    """The faults applied to one service call.

    Attributes:
        drop: Whether the call gets no response.
        delay_sec: The delay of its response in seconds of the server's clock.
        refuse: Whether the server refuses it.
    """

    drop: bool = False
    delay_sec: float = 0.0
    refuse: bool = False


class ServiceFaults:
    """The faults of one service, consumed call by call: first the drops, then the refusals."""

    def __init__(self, faults: Sequence[Fault] = ()) -> None:
        self._drops = sum(fault.count for fault in faults if fault.kind == "drop")
        self._refusals = sum(fault.count for fault in faults if fault.kind == "refuse")
        self._delay_sec = sum(fault.seconds for fault in faults if fault.kind == "delay")

    def next_call(self) -> CallFaults:
        """Return the faults of the next call."""
        if self._drops > 0:
            self._drops -= 1
            return CallFaults(drop=True)
        refuse = self._refusals > 0
        self._refusals -= refuse
        return CallFaults(delay_sec=self._delay_sec, refuse=refuse)


class NavigationFaults:
    """The faults of navigation. Aborts and codes affect every goal at their location, other faults one goal each."""

    def __init__(self, faults: Sequence[Fault] = ()) -> None:
        self._rejections = sum(fault.count for fault in faults if fault.kind == "reject")
        self.delay_sec = sum(fault.seconds for fault in faults if fault.kind == "delay")
        self._lasting = [fault for fault in faults if _is_lasting(fault)]
        self._single = [fault for fault in faults if fault.kind in _AT_ONE_GOAL and not _is_lasting(fault)]
        self.places = {fault.place: fault for fault in faults if fault.place}

    def check_places(self, known: Collection[str]) -> None:
        """Check that the location of every fault exists.

        Raises:
            FaultError: If a location does not exist.
        """
        for place, fault in self.places.items():
            _require_among(str(fault), "place", place, known)

    def should_reject(self) -> bool:
        """Return whether to reject the next goal."""
        reject = self._rejections > 0
        self._rejections -= reject
        return reject

    def fault_for_goal(self, place: str | None) -> Fault | None:
        """Return the fault of a newly accepted goal; None if it has none.

        Args:
            place: The location of the goal, or None.
        """
        for fault in (*self._lasting, *self._single):
            if fault.place in {place, ""}:
                if fault in self._single:
                    self._single.remove(fault)
                return fault
        return None


# Once for each goal at a location; without a location, a slow computer slows every goal.
_AT_ONE_GOAL = ("die", "late", "starved", "succeed")


def _is_lasting(fault: Fault) -> bool:
    return fault.kind in ("code", "abort") or (
        fault.kind in ("late", "starved", "succeed") and not fault.place
    )


class FaultPlan:
    """All faults of one run.

    Args:
        faults: The requested faults, in any order.
        places: Positions (metres, frame `map`) that identify goals; the world's markers if None.
            seed: The run's seed, for servers with random behaviour.

    Attributes:
        faults: The requested faults.
        places: The positions, or None.
        seed: The seed.
    """

    def __init__(
        self,
        faults: Sequence[Fault] = (),
        places: Mapping[str, tuple[float, float]] | None = None,
        seed: int = 0,
    ) -> None:
        self.faults = tuple(faults)
        self.places = places
        self.seed = seed

    def for_service(self, name: str) -> ServiceFaults:
        """Return the unused faults of the service *name*."""
        return ServiceFaults([fault for fault in self.faults if fault.target == name])

    def for_navigation(self) -> NavigationFaults:
        """Return the unused faults of the Nav2 substitute."""
        return NavigationFaults([fault for fault in self.faults if fault.target in NAVIGATION_FAULTS])


ServiceCallback = Callable[[Any, Any], Any]


def create_service(
    node: "Node",
    service_type: Any,
    name: str,
    answer: ServiceCallback,
    *,
    refuse: ServiceCallback | None = None,
    faults: ServiceFaults | None = None,
) -> "Service":
    """Create a service server on *node* with fault injection.

    Args:
        node: Its node; the delays run on this node's clock.
        service_type: The service's type.
        name: Its name.
        answer: Fills in the response of an ordinary call and returns it; `answer(request, response)`.
        refuse: The same for a refused call; *answer* by default.
        faults: The faults of the service; none by default.

    A dropped call is not passed to *answer*. A delayed call is passed to it after the delay; other calls and the rest of the node are
    served meanwhile.
    """
    if faults is None:
        return node.create_service(service_type, name, answer)

    def answer_by(fate: CallFaults, request: Any, response: Any) -> Any:
        if fate.refuse:
            node.get_logger().warning(f"Fault: {name} refuses a call.")
            return (refuse or answer)(request, response)
        return answer(request, response)

    def decide(request: Any, response: Any) -> tuple[CallFaults, Any, Any]:
        return faults.next_call(), request, response

    service = node.create_service(service_type, name, decide)
    send = service.send_response

    def send_by(decided: tuple[CallFaults, Any, Any], header: Any) -> None:
        fate = decided[0]
        if fate.drop:
            node.get_logger().warning(f"Fault: {name} does not respond to a call.")
        elif fate.delay_sec > 0.0:
            node.get_logger().warning(f"Fault: {name} responds {fate.delay_sec:g} s late.")
            _call_later(node, fate.delay_sec, lambda: send(answer_by(*decided), header))
        else:
            send(answer_by(*decided), header)

    # The executor sends every value that a callback returns, so a response can only be delayed or dropped here.
    service.send_response = send_by
    return service


def _call_later(node: "Node", seconds: float, action: Callable[[], object]) -> None:
    """Call a function once, after a time on the node's clock."""

    def end() -> None:
        node.destroy_timer(timer)
        action()

    timer = node.create_timer(seconds, end)


def _require_among(text: str, what: str, word: str, words: Collection[str]) -> None:
    if word in words:
        return
    listed = ", ".join(words) or "none"
    raise FaultError(text, f"'{word}' is no {what} (known: {listed}){did_you_mean(nearest(word, words))}")


def _count(text: str, value: str) -> int:
    if not (value.isascii() and value.isdigit() and int(value) > 0):
        raise FaultError(text, f"'{value}' is not an integer above 0")
    return int(value)


def _seconds(text: str, value: str) -> float:
    number, factor = (value[:-2], 0.001) if value.endswith("ms") else (value.removesuffix("s"), 1.0)
    try:
        seconds = float(number) * factor
    except ValueError:
        seconds = math.nan
    if not (math.isfinite(seconds) and seconds > 0.0):
        raise FaultError(text, f"'{value}' is not a number of seconds above 0")
    return seconds


def _check_place(text: str, value: str) -> str:
    if not re.fullmatch(r"[\w.-]+", value):
        raise FaultError(text, f"'{value}' is not the name of a location")
    return value


# Attributes of options with another name.
_OPTIONS = {"after": "seconds"}
_AMOUNTS: Mapping[str, Callable[[str, str], Any]] = {
    "count": _count,
    "code": _count,
    "seconds": _seconds,
    "place": _check_place,
}

"""Fault injection: parse the faults of `--fault`, and create service servers that inject these faults.

Only `create_service` uses ROS.
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
"""The possible faults of the simulated Nav2, by target. Every mission has these faults."""


class _FaultForm(NamedTuple):
    """The syntax of one kind of fault.

    Attributes:
        text: The syntax, as in messages.
        parts: The parts that may follow the kind: `=` for a value, `@` for a location, `=@` for both, or an
            empty string for neither.
        amount: The attribute of `Fault` that the value sets; empty if the fault has no value.
        option: The name of the option after the comma; empty if the fault has no option. The option's value
            is in seconds.
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
        spec: The fault as written by the user.
        problem: The description of the error.
    """

    def __init__(self, spec: str, problem: str) -> None:
        self.spec, self.problem = spec, problem
        super().__init__(f"fault '{spec}': {problem}")


@dataclass(frozen=True)
class Fault:
    """A fault to inject into a simulated server.

    Attributes:
        target: The service or action, such as `navigate_to_pose`, or the node `amcl`.
        kind: `drop`, `delay`, `refuse`, `abort`, `code`, `late`, `starved`, `succeed`, `reject` or `die`.
        count: The number of affected calls or goals (`drop`, `refuse`, `reject`).
        seconds: A time in seconds of the server's clock: the delay of each response (`delay`), the duration
            of the drive before the goal ends (`code`), or the delay until one Nav2 server acknowledges the
            goal of another server (`late`).
        place: The affected location (`abort`, `code`, `late`, `starved`, `succeed`, `die`); an empty string
            for all locations.
        code: The error code with which a goal ends (`code`).
        drives: How long the robot continues to drive after a goal has ended, in seconds of the server's clock (`late`).
        back: The time until a crashed server is available again, in simulated seconds; None if it stays unavailable (`die`).
        text: The fault as written by the user.
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
        text: The fault as written by the user.
        targets: The possible kinds of faults by service, action or node.

    Raises:
        FaultError: If the fault is invalid; the message contains the valid syntax.
    """
    target, colon, rest = text.strip().partition(":")
    _require_among(text, "target", target, targets)
    if not colon or not rest:
        allowed = ", ".join(f"{target}:{_FORMS[kind].text}" for kind in targets[target])
        raise FaultError(text, f"the kind of fault is missing. Write one of {allowed}")
    match = _SHAPE.fullmatch(rest)
    kind, value, place, option, seconds = match.groups() if match else ("", None, None, None, "")
    _require_among(text, f"fault of {target}", kind, targets[target])
    form = _FORMS[kind]
    parts = f"{'=' if value is not None else ''}{'@' if place is not None else ''}"
    if parts not in form.parts or "" in {value, place}:
        raise FaultError(text, f"expected {target}:{form.text}")
    if option is not None and option != form.option:
        raise FaultError(text, f"unknown option '{option}={seconds}'. Expected {target}:{form.text}")
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
    """The faults that affect one service call.

    Attributes:
        drop: Whether the call gets no response.
        delay_sec: The delay of the response, in seconds of the server's clock.
        refuse: Whether the server refuses the call.
    """

    drop: bool = False
    delay_sec: float = 0.0
    refuse: bool = False


class ServiceFaults:
    """The remaining faults of one service.

    Each call consumes one drop, or one refusal if no drops are left. Delays affect all calls.
    """

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
    """The remaining faults of the simulated Nav2.

    The faults `abort` and `code` affect every goal at the fault's location. The faults `late`, `starved` and
    `succeed` affect every goal if they have no location, and otherwise one goal. All other faults affect one
    goal.
    """

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
        """Return the fault that affects a newly accepted goal, or None if no fault affects the goal.

        Args:
            place: The location of the goal, or None.
        """
        for fault in (*self._lasting, *self._single):
            if fault.place in {place, ""}:
                if fault in self._single:
                    self._single.remove(fault)
                return fault
        return None


# The faults that affect only one goal at their location. Without a location, all of them except `die` affect every goal.
_AT_ONE_GOAL = ("die", "late", "starved", "succeed")


def _is_lasting(fault: Fault) -> bool:
    return fault.kind in ("code", "abort") or (
        fault.kind in ("late", "starved", "succeed") and not fault.place
    )


class FaultPlan:
    """All faults of one run.

    Args:
        faults: The faults to inject, in any order.
        places: The positions of the locations that faults can name, in metres, frame `map`; None for the locations of the simulated world.
        seed: The run's seed, for servers with random behaviour.

    Attributes:
        faults: The faults to inject.
        places: The positions of the locations, or None.
        seed: The run's seed.
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
        """Return the faults of the service *name* at the start of a run, before any call."""
        return ServiceFaults([fault for fault in self.faults if fault.target == name])

    def for_navigation(self) -> NavigationFaults:
        """Return the faults of the simulated Nav2 at the start of a run, before any goal."""
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
    """Create a service server with fault injection.

    Args:
        node: The server's node, whose clock measures delays.
        service_type: The service's type.
        name: The service's name.
        answer: Called as `answer(request, response)`; fills in the response and returns it.
        refuse: Called instead of *answer* for a refused call; *answer* by default.
        faults: The faults of the service; none by default.

    A dropped call is not passed to *answer*. A delayed call is passed to *answer* after the delay. During the delay, the node executes other
    calls and callbacks.
    """
    if faults is None:
        return node.create_service(service_type, name, answer)

    def fill_response(call_faults: CallFaults, request: Any, response: Any) -> Any:
        if call_faults.refuse:
            node.get_logger().warning(f"Fault: {name} refuses a call.")
            return (refuse or answer)(request, response)
        return answer(request, response)

    def decide(request: Any, response: Any) -> tuple[CallFaults, Any, Any]:
        return faults.next_call(), request, response

    service = node.create_service(service_type, name, decide)
    send = service.send_response

    def send_response(decided: tuple[CallFaults, Any, Any], header: Any) -> None:
        call_faults = decided[0]
        if call_faults.drop:
            node.get_logger().warning(f"Fault: {name} does not respond to a call.")
        elif call_faults.delay_sec > 0.0:
            node.get_logger().warning(f"Fault: {name} responds {call_faults.delay_sec:g} s late.")
            _call_later(node, call_faults.delay_sec, lambda: send(fill_response(*decided), header))
        else:
            send(fill_response(*decided), header)

    # The executor sends every value that a callback returns, so a response can only be delayed or dropped here.
    service.send_response = send_response
    return service


def _call_later(node: "Node", seconds: float, action: Callable[[], object]) -> None:
    """Call a function once, after a delay that is measured on the node's clock."""

    def end() -> None:
        node.destroy_timer(timer)
        action()

    timer = node.create_timer(seconds, end)


def _require_among(text: str, what: str, word: str, words: Collection[str]) -> None:
    if word in words:
        return
    listed = ", ".join(words) or "none"
    raise FaultError(text, f"unknown {what} '{word}' (known: {listed}){did_you_mean(nearest(word, words))}")


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


# The attributes of `Fault` whose names differ from their options.
_OPTIONS = {"after": "seconds"}
_AMOUNTS: Mapping[str, Callable[[str, str], Any]] = {
    "count": _count,
    "code": _count,
    "seconds": _seconds,
    "place": _check_place,
}

"""The leaves of the traces: they return the outcomes of the file, and record their events."""

from dataclasses import dataclass, field

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.leaves import Kind, register
from sar_compiler.runtime.context import mission_context
from sar_compiler.runtime.ports import Input, PortError
from sar_compiler.runtime.skipping import SKIPPED, SkippableLeaf

_OUTCOMES = {"S": Status.SUCCESS, "F": Status.FAILURE, "R": Status.RUNNING, "K": SKIPPED}
_ALL = {Status.SUCCESS, Status.FAILURE, Status.RUNNING, SKIPPED}

Event = list[str]


def _nothing() -> "Events":
    return Events()


@mission_context(preview=_nothing)
@dataclass
class Events:
    """The events, in order."""

    happened: list[Event] = field(default_factory=list)

    def take(self) -> list[Event]:
        """Return the events since the last call."""
        taken, self.happened = self.happened, []
        return taken


class ScriptedError(Exception):
    """The error that a leaf raises if its file requests it."""


class _Answering(SkippableLeaf):
    def __init__(
        self,
        name: str,
        id_: Input[str],
        outcomes: Input[str] | None,
        restart: Input[bool] | None,
        events: Events,
    ) -> None:
        super().__init__(name)
        self._id = id_
        self._outcomes = outcomes or Input("S")
        self._restart = restart or Input(source=False)
        self._events = events
        self._asked = 0

    def initialise(self) -> None:
        if self._restart.get():
            self._asked = 0

    def update(self) -> Status:
        answers = self._outcomes.get().split(",")
        answer = answers[min(self._asked, len(answers) - 1)]
        self._asked += 1
        if answer == "X":
            self._events.happened.append(["tick", self._id.get(), "EXCEPTION"])
            message = f"scripted throw in {self.name}"
            raise ScriptedError(message)
        status = _OUTCOMES[answer]
        self._events.happened.append(
            ["tick", self._id.get(), "SKIPPED" if status == SKIPPED else status.name]
        )
        return status


@register("Scripted", kind=Kind.ACTION, outcomes=_ALL)
class Scripted(_Answering):
    """Returns one status of a list at each tick."""

    def __init__(
        self,
        name: str,
        id_: Input[str],
        events: Events,
        outcomes: Input[str] | None = None,
        restart: Input[bool] | None = None,
    ) -> None:
        super().__init__(name, id_, outcomes, restart, events)

    def terminate(self, new_status: Status) -> None:
        if new_status == Status.INVALID and self.status == Status.RUNNING:
            self._events.happened.append(["halt", self._id.get()])


@register("Cond", kind=Kind.CONDITION, outcomes=_ALL)
class Cond(_Answering):
    """Returns statuses as Scripted does, but is a condition, and records no halt."""

    def __init__(
        self,
        name: str,
        id_: Input[str],
        events: Events,
        outcomes: Input[str] | None = None,
        restart: Input[bool] | None = None,
    ) -> None:
        super().__init__(name, id_, outcomes, restart, events)


class _Showing(Behaviour):
    def __init__(self, name: str, id_: Input[str], port: Input[object] | Input[str], events: Events) -> None:
        super().__init__(name)
        self._id = id_
        self._port = port
        self._events = events

    def update(self) -> Status:
        try:
            value = self._port.get()
        except PortError as error:
            self._events.happened.append(["show", self._id.get(), f"<error: {error}>"])
            return Status.FAILURE
        if isinstance(value, bool):
            value = int(value)
        text = f"{value:f}" if isinstance(value, float) else str(value)
        self._events.happened.append(["show", self._id.get(), text])
        return Status.SUCCESS


@register("Show", kind=Kind.ACTION, outcomes={Status.SUCCESS, Status.FAILURE})
class Show(_Showing):
    """Records the value of its port, which may have any type."""

    def __init__(self, name: str, id_: Input[str], value: Input[object], events: Events) -> None:
        super().__init__(name, id_, value, events)


@register("ShowS", kind=Kind.ACTION, outcomes={Status.SUCCESS, Status.FAILURE})
class ShowS(_Showing):
    """Records the value of its port, which is a string."""

    def __init__(self, name: str, id_: Input[str], value: Input[str], events: Events) -> None:
        super().__init__(name, id_, value, events)

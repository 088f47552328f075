"""Leaves without internal state: their outcome depends only on the seed, the tick and their earlier updates in it."""

import random
from dataclasses import dataclass, field

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.leaves import Kind, register
from sar_compiler.runtime.context import mission_context
from sar_compiler.runtime.skipping import SKIPPED, SkippableLeaf

Event = tuple[str, ...]

_ENDS_OR_RUNS = (Status.SUCCESS, Status.FAILURE, Status.RUNNING)


class ProbeError(Exception):
    """The error that a probe raises occasionally if its script says so."""


@mission_context(preview=lambda: Script())  # noqa: PLW0108 - the class does not exist yet
@dataclass
class Script:
    """Chooses the outcomes of a tree's probes and records the calls of their methods."""

    seed: int = 0
    raises: bool = False
    tick: int = 0
    events: list[Event] = field(default_factory=list)

    def choose_status(self, name: str, may_skip: bool) -> Status:
        times = sum(event == (name, "update") for event in self.events)
        chance = random.Random(f"{self.seed} {name} {self.tick} {times}")  # noqa: S311 - the same trees in every run
        if self.raises and chance.random() < 0.01:
            raise ProbeError(name)
        if may_skip:
            return chance.choice((*_ENDS_OR_RUNS, SKIPPED))
        # A leaf should not return INVALID, but it can.
        return Status.INVALID if chance.random() < 0.03 else chance.choice(_ENDS_OR_RUNS)

    def pop_events(self) -> list[Event]:
        """Return the events since the last call."""
        taken, self.events = self.events, []
        return taken


@register("Probe", kind=Kind.ACTION, outcomes={Status.SUCCESS, Status.FAILURE, Status.RUNNING})
class Probe(Behaviour):
    """Returns random outcomes, and records the calls of its methods with its status at that time."""

    def __init__(self, name: str, script: Script) -> None:
        super().__init__(name)
        self._script = script

    def initialise(self) -> None:
        self._script.events.append((self.name, "initialise", self.status.name))

    def update(self) -> Status:
        self._script.events.append((self.name, "update"))
        self.feedback_message = f"tick {self._script.tick}"
        return self._script.choose_status(self.name, may_skip=False)

    def terminate(self, new_status: Status) -> None:
        self._script.events.append((self.name, "terminate", self.status.name, new_status.name))


@register("Skipper", kind=Kind.ACTION, outcomes={Status.SUCCESS, Status.FAILURE, Status.RUNNING, SKIPPED})
class Skipper(SkippableLeaf, Probe):
    """A probe that can also be skipped."""

    def update(self) -> Status:
        super().update()
        return self._script.choose_status(self.name, may_skip=True)

"""Controls and decorators as users write them: with `begin` and `resume`, or with a `tick` of their own."""

from collections.abc import Iterator

from py_trees import composites, decorators
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.leaves import SKIPPED, Clock, Control, Decorator, Kind, Semantics, Tick, register

Next = Behaviour | Status


@register("OwnSequence", kind=Kind.CONTROL, semantics=Semantics.sequence())
class OwnSequence(Control):
    """Ticks its children in order until one does not succeed."""

    going_on = Status.SUCCESS

    def __init__(self, name: str, children: list[Behaviour]) -> None:
        super().__init__(name, children)
        self.ran = self.cell()

    def begin(self, tick: Tick) -> Next:
        return self.children[tick.child_index]

    def resume(self, tick: Tick, outcome: Status) -> Next:
        tick[self.ran] = tick[self.ran] or outcome is not SKIPPED
        if outcome not in (self.going_on, SKIPPED):
            return outcome
        if tick.child_index + 1 < len(self.children):
            return self.children[tick.child_index + 1]
        return self.going_on if tick[self.ran] else SKIPPED


@register("OwnFallback", kind=Kind.CONTROL, semantics=Semantics.selector())
class OwnFallback(OwnSequence):
    """Ticks its children in order until one does not fail."""

    going_on = Status.FAILURE


@register("OwnReactiveFallback", kind=Kind.CONTROL, semantics=Semantics.selector(reactive=True))
class OwnReactiveFallback(OwnFallback):
    """Starts with its first child in every tick."""

    def begin(self, tick: Tick) -> Next:
        tick[self.ran] = 0
        return self.children[0]

    def resume(self, tick: Tick, outcome: Status) -> Next:
        found = super().resume(tick, outcome)
        if found is Status.RUNNING:
            for child in self.children:
                if child is not self.children[tick.child_index]:
                    tick.halt(child)
        return found


@register("OwnRecovery", kind=Kind.CONTROL, child_count=(2, 2))
class OwnRecovery(Control):
    """Ticks its first child; when that has failed, the second one, and then the first one again.

    Args:
        retries: The number of further attempts.
    """

    def __init__(self, name: str, children: list[Behaviour], retries: int = 1) -> None:
        super().__init__(name, children)
        self.retries = retries
        self.tried = self.cell()

    def begin(self, tick: Tick) -> Next:
        return self.children[tick.child_index]

    def resume(self, tick: Tick, outcome: Status) -> Next:
        if tick.child_index and outcome is Status.SUCCESS:
            tick[self.tried] += 1
            return self.children[0]
        if not tick.child_index and outcome is Status.FAILURE and tick[self.tried] < self.retries:
            return self.children[1]
        return outcome


@register("OwnTurn", kind=Kind.CONTROL)
class OwnTurn(Control):
    """Ticks one child in each activation, in turn."""

    def __init__(self, name: str, children: list[Behaviour]) -> None:
        super().__init__(name, children)
        self.turn = self.cell(keeps=True)

    def begin(self, tick: Tick) -> Next:
        turn: int = tick[self.turn]
        return self.children[turn]

    def resume(self, tick: Tick, outcome: Status) -> Next:
        if outcome is not Status.RUNNING:
            tick[self.turn] = (tick[self.turn] + 1) % len(self.children)
        return outcome


@register("OwnInverter", kind=Kind.DECORATOR)
class OwnInverter(Decorator):
    """Turns its child's success into a failure, and vice versa."""

    def __init__(self, name: str, child: Behaviour) -> None:
        super().__init__(name, child)

    def resume(self, tick: Tick, outcome: Status) -> Next:
        return {Status.SUCCESS: Status.FAILURE, Status.FAILURE: Status.SUCCESS}.get(outcome, outcome)


@register("OwnCount", kind=Kind.DECORATOR)
class OwnCount(OwnInverter):
    """Fails after a number of ticks.

    Args:
        most: The number of its ticks that may succeed.
    """

    def __init__(self, name: str, child: Behaviour, most: int = 3) -> None:
        super().__init__(name, child)
        self.most = most
        self.seen = self.cell(())

    def resume(self, tick: Tick, outcome: Status) -> Next:
        tick[self.seen] += (outcome.name,)
        return Status.FAILURE if len(tick[self.seen]) > self.most else outcome


@register("OwnTimeout", kind=Kind.DECORATOR)
class OwnTimeout(OwnInverter):
    """Fails when its child has run for too long.

    Args:
        seconds: The time limit.
        clock: Measures the time.
    """

    def __init__(self, name: str, child: Behaviour, clock: Clock, seconds: float = 5.0) -> None:
        super().__init__(name, child)
        self.clock = clock
        self.seconds = seconds
        self.runs = self.cell(first=False)

    def begin(self, tick: Tick) -> Next:
        if not tick[self.runs]:
            tick[self.runs] = True
            tick.start_timer(self.seconds)
        elif tick.time_is_up():
            return Status.FAILURE
        return super().begin(tick)

    def resume(self, tick: Tick, outcome: Status) -> Next:
        return outcome


@register("OwnLimit", kind=Kind.DECORATOR, semantics=Semantics.limits_child("seconds"))
class OwnLimit(OwnTimeout):
    """Does the same, with declared semantics."""


@register("OwnDebounce", kind=Kind.DECORATOR)
class OwnDebounce(OwnTimeout):
    """Succeeds when its child's outcome is unchanged for some time, but restarts this time in every tick."""

    def begin(self, tick: Tick) -> Next:
        return super().begin(tick)

    def resume(self, tick: Tick, outcome: Status) -> Next:
        tick.start_timer(self.seconds)
        return Status.RUNNING


@register("OwnHours", kind=Kind.DECORATOR)
class OwnHours(OwnTimeout):
    """Returns SUCCESS once an hour has passed."""

    def begin(self, tick: Tick) -> Next:
        return Status.SUCCESS if self.clock.now() // 3600 else Status.FAILURE


@register("OwnTally", kind=Kind.DECORATOR)
class OwnTally(OwnInverter):
    """Counts in an attribute."""

    def __init__(self, name: str, child: Behaviour) -> None:
        super().__init__(name, child)
        self.ticks = 0

    def resume(self, tick: Tick, outcome: Status) -> Next:
        self.ticks += 1
        return outcome


@register("OwnList", kind=Kind.DECORATOR)
class OwnList(OwnInverter):
    """Counts in a list."""

    def __init__(self, name: str, child: Behaviour) -> None:
        super().__init__(name, child)
        self.seen: list[Status] = []

    def begin(self, tick: Tick) -> Next:
        self.seen.append(self.status)
        return super().begin(tick)


@register("OwnEndless", kind=Kind.DECORATOR)
class OwnEndless(OwnInverter):
    """Counts its ticks without limit."""

    def __init__(self, name: str, child: Behaviour) -> None:
        super().__init__(name, child)
        self.ticks = self.cell()

    def resume(self, tick: Tick, outcome: Status) -> Next:
        tick[self.ticks] += 1
        return outcome


@register("OwnStray", kind=Kind.DECORATOR)
class OwnStray(OwnInverter):
    """Returns itself instead of its child to be ticked."""

    def begin(self, tick: Tick) -> Next:
        return self


@register("OwnSilence", kind=Kind.DECORATOR)
class OwnSilence(OwnInverter):
    """Returns None after its child."""

    def resume(self, tick: Tick, outcome: Status) -> Next:
        return None  # type: ignore[return-value]


@register("OwnTwice", kind=Kind.CONTROL)
class OwnTwice(Control):
    """Ticks all of its children twice in a tick, and counts their successes."""

    def __init__(self, name: str, children: list[Behaviour]) -> None:
        super().__init__(name, children)
        self.ticks, self.successes = self.cell(), self.cell()

    def begin(self, tick: Tick) -> Next:
        tick[self.ticks] = tick[self.successes] = 0
        return self.children[0]

    def resume(self, tick: Tick, outcome: Status) -> Next:
        count = len(self.children)
        tick[self.ticks] += 1
        tick[self.successes] += outcome is Status.SUCCESS
        if tick[self.ticks] < 2 * count:
            following: int = tick[self.ticks] % count
            return self.children[following]
        return Status.SUCCESS if tick[self.successes] > count else Status.RUNNING


@register("OwnLiar", kind=Kind.CONTROL, semantics=Semantics.sequence())
class OwnLiar(OwnFallback):
    """Is registered as a sequence, but behaves differently."""


@register("OwnBoast", kind=Kind.DECORATOR, outcomes={Status.SUCCESS})
class OwnBoast(OwnInverter):
    """Is registered to succeed always, but may fail."""


def wrong_number(_bound: object, children: list[int], _sure: bool) -> int:
    return children[7]


def no_number(*_: object) -> None:
    """Return None instead of an outcome set."""


@register("OwnSlip", kind=Kind.CONTROL, semantics=Semantics(wrong_number))  # type: ignore[arg-type]
class OwnSlip(OwnSequence):
    """Is described by a function that raises an error."""


@register("OwnGap", kind=Kind.CONTROL, semantics=Semantics(no_number))  # type: ignore[arg-type]
class OwnGap(OwnSequence):
    """Is described by a function that returns None."""


class Ticking(composites.Composite):
    """A control with a `tick` of its own: ticks its children in order until one returns another status."""

    going_on = Status.SUCCESS

    def __init__(self, name: str, children: list[Behaviour]) -> None:
        super().__init__(name, children)
        self.index = 0

    def tick(self) -> Iterator[Behaviour]:
        self.status = self.going_on
        while self.index < len(self.children):
            child = self.children[self.index]
            yield from child.tick()
            if child.status != self.going_on:
                self.status = child.status
                break
            self.index += 1
        if self.status is not Status.RUNNING:
            self.stop(self.status)
        yield self

    def stop(self, new_status: Status = Status.INVALID) -> None:
        super().stop(new_status)
        self.index = 0


@register("TickingSequence", kind=Kind.CONTROL, semantics=Semantics.sequence())
class TickingSequence(Ticking):
    """Declares that it is a sequence."""


@register("TickingFallback", kind=Kind.CONTROL, semantics=Semantics.selector())
class TickingFallback(Ticking):
    """Declares that it is a fallback."""

    going_on = Status.FAILURE


@register("TickingReactive", kind=Kind.CONTROL, semantics=Semantics.selector(reactive=True))
class TickingReactive(TickingFallback):
    """Declares that it is a reactive fallback."""


@register("TickingPauses", kind=Kind.CONTROL, semantics=Semantics.sequence(pauses=True))
class TickingPauses(TickingSequence):
    """Declares that it pauses between its children."""


@register("TickingPlace", kind=Kind.CONTROL, semantics=Semantics.sequence(pauses=True, keeps_place=True))
class TickingPlace(TickingSequence):
    """Declares that it resumes at its last child."""


@register("TickingMystery", kind=Kind.CONTROL)
class TickingMystery(TickingSequence):
    """Declares no semantics."""


class Updating(decorators.Decorator):
    """A decorator as py_trees defines it."""

    def __init__(self, name: str, child: Behaviour) -> None:
        super().__init__(name, child)

    def update(self) -> Status:
        return self.decorated.status


@register(
    "TickingTurn",
    kind=Kind.DECORATOR,
    semantics=Semantics.mapping({Status.SUCCESS: Status.FAILURE, Status.FAILURE: Status.SUCCESS}),
)
class TickingTurn(Updating):
    """Declares that it inverts the outcome of its child."""


@register("TickingPass", kind=Kind.DECORATOR, semantics=Semantics.transparent())
class TickingPass(Updating):
    """Declares that it returns the outcome of its child."""


@register("TickingLimit", kind=Kind.DECORATOR, semantics=Semantics.limits_child("seconds"))
class TickingLimit(Updating):
    """Declares that it limits the time of its child.

    Args:
        seconds: The limit.
    """

    def __init__(self, name: str, child: Behaviour, seconds: float = 5.0) -> None:
        super().__init__(name, child)
        self.seconds = seconds


@register("TickingRetry", kind=Kind.DECORATOR, semantics=Semantics.restarts_child(Status.FAILURE, "attempts"))
class TickingRetry(Updating):
    """Declares that it retries its child.

    Args:
        attempts: The number of attempts.
    """

    def __init__(self, name: str, child: Behaviour, attempts: int = 2) -> None:
        super().__init__(name, child)
        self.attempts = attempts


@register(
    "TickingRounds", kind=Kind.DECORATOR, semantics=Semantics.restarts_child(Status.SUCCESS, "attempts")
)
class TickingRounds(TickingRetry):
    """Declares that it repeats its child."""


@register("OwnForgetful", kind=Kind.DECORATOR)
class OwnForgetful(Updating):
    """Returns no status."""

    def update(self) -> Status:
        return None  # type: ignore[return-value]

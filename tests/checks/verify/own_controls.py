"""Controls and decorators as a user may write them: py_trees classes with a `tick`, or an `update`, of their own."""

import random
import threading
import time
from collections.abc import Iterator

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Composite
from py_trees.decorators import Decorator

from sar_compiler import Clock, Kind, Semantics, register


class Own(Composite):
    """Ticks its children by a rule of its own, and brings them all to rest at its end."""

    def __init__(self, name: str, children: list[Behaviour]) -> None:
        super().__init__(name, children)
        self.index = 0

    def finish(self, status: Status) -> None:
        self.status = status
        if status is not Status.RUNNING:
            self.index = 0
            for child in self.children:
                child.stop(Status.INVALID)

    def stop(self, new_status: Status = Status.INVALID) -> None:
        super().stop(new_status)
        self.index = 0


@register("OwnSequence", kind=Kind.CONTROL, semantics=Semantics.sequence())
class OwnSequence(Own):
    """Ticks its children in order until one does not succeed."""

    going_on = Status.SUCCESS

    def tick(self) -> Iterator[Behaviour]:
        while self.index < len(self.children):
            child = self.children[self.index]
            yield from child.tick()
            if child.status != self.going_on:
                self.finish(child.status)
                yield self
                return
            self.index += 1
        self.finish(self.going_on)
        yield self


@register("OwnFallback", kind=Kind.CONTROL, semantics=Semantics.selector())
class OwnFallback(OwnSequence):
    """Ticks its children in order until one does not fail."""

    going_on = Status.FAILURE


@register("OwnReactiveFallback", kind=Kind.CONTROL, semantics=Semantics.selector(reactive=True))
class OwnReactiveFallback(Own):
    """Begins with its first child in every tick."""

    def tick(self) -> Iterator[Behaviour]:
        for number, child in enumerate(self.children):
            yield from child.tick()
            if child.status != Status.FAILURE:
                for other in self.children[number + 1 :]:
                    if other.status == Status.RUNNING:
                        other.stop(Status.INVALID)
                self.finish(child.status)
                yield self
                return
        self.finish(Status.FAILURE)
        yield self


@register("OwnRecovery", kind=Kind.CONTROL, child_count=(2, 2))
class OwnRecovery(Own):
    """Ticks its first child; when that has failed, the second one, and then the first one again.

    Args:
        retries: How often it is tried again.
    """

    def __init__(self, name: str, children: list[Behaviour], retries: int = 1) -> None:
        super().__init__(name, children)
        self.retries = retries
        self.tried = 0

    def tick(self) -> Iterator[Behaviour]:
        if self.status != Status.RUNNING:
            self.tried = 0
        while True:
            child = self.children[self.index]
            yield from child.tick()
            if child.status == Status.RUNNING:
                self.finish(Status.RUNNING)
                break
            if child.status == Status.SUCCESS and self.index:
                self.index, self.tried = 0, self.tried + 1
                self.children[1].stop(Status.INVALID)
            elif child.status == Status.FAILURE and not self.index and self.tried < self.retries:
                self.index = 1
                self.children[0].stop(Status.INVALID)
            else:
                self.finish(child.status)
                break
        yield self


@register("OwnInverter", kind=Kind.DECORATOR)
class OwnInverter(Decorator):
    """Turns its child's success into a failure, and the other way round."""

    def __init__(self, name: str, child: Behaviour) -> None:
        super().__init__(name, child)

    def update(self) -> Status:
        turned = {Status.SUCCESS: Status.FAILURE, Status.FAILURE: Status.SUCCESS}
        return turned.get(self.decorated.status, self.decorated.status)


@register("OwnCount", kind=Kind.DECORATOR)
class OwnCount(OwnInverter):
    """Fails from a number of ticks on.

    Args:
        most: How many of its ticks may succeed.
    """

    def __init__(self, name: str, child: Behaviour, most: int = 3) -> None:
        super().__init__(name, child)
        self.most = most
        self.seen: list[str] = []

    def update(self) -> Status:
        self.seen.append(self.decorated.status.name)
        return Status.FAILURE if len(self.seen) > self.most else self.decorated.status

    def terminate(self, new_status: Status) -> None:
        self.seen.clear()


@register("OwnTimeout", kind=Kind.DECORATOR)
class OwnTimeout(OwnInverter):
    """Fails when its child has run for too long.

    Args:
        seconds: For how long it may.
        clock: Measures that.
    """

    def __init__(self, name: str, child: Behaviour, clock: Clock, seconds: float = 5.0) -> None:
        super().__init__(name, child)
        self.clock = clock
        self.seconds = seconds
        self.started = 0.0

    def initialise(self) -> None:
        self.started = self.clock.now()

    def update(self) -> Status:
        if self.decorated.status == Status.RUNNING and self.clock.now() - self.started >= self.seconds:
            return Status.FAILURE
        return self.decorated.status


@register("OwnLimit", kind=Kind.DECORATOR, semantics=Semantics.limiting("seconds"))
class OwnLimit(OwnTimeout):
    """The same, with its meaning."""


@register("OwnDebounce", kind=Kind.DECORATOR)
class OwnDebounce(OwnTimeout):
    """Succeeds when its child has done the same for some time, which begins anew in every tick: never, that is."""

    def update(self) -> Status:
        left = self.started + self.seconds - self.clock.now()
        self.started = self.clock.now()
        return Status.SUCCESS if left <= 0 else Status.RUNNING


@register("OwnThread", kind=Kind.DECORATOR)
class OwnThread(OwnInverter):
    """Has somebody else work for it."""

    def __init__(self, name: str, child: Behaviour) -> None:
        super().__init__(name, child)
        self.worker = threading.Thread(target=print)


@register("OwnChance", kind=Kind.DECORATOR)
class OwnChance(OwnInverter):
    """Leaves to chance what it answers."""

    def update(self) -> Status:
        self.drawn = random.random()  # noqa: S311 - any will do
        return Status.SUCCESS if self.drawn > 0.5 else Status.FAILURE


@register("OwnStopwatch", kind=Kind.DECORATOR)
class OwnStopwatch(OwnInverter):
    """Measures the machine's time."""

    def initialise(self) -> None:
        self.began = time.perf_counter()


@register("OwnTally", kind=Kind.DECORATOR)
class OwnTally(OwnInverter):
    """Counts what all of its kind do."""

    ticks = 0

    def update(self) -> Status:
        OwnTally.ticks += 1
        return (Status.SUCCESS, Status.FAILURE)[OwnTally.ticks % 2]


@register("OwnOrphanage", kind=Kind.CONTROL)
class OwnOrphanage(OwnSequence):
    """Leaves its last child in its second tick."""

    def tick(self) -> Iterator[Behaviour]:
        yield from super().tick()
        if len(self.children) > 1:
            self.remove_child(self.children[-1])


@register("OwnCatch", kind=Kind.CONTROL)
class OwnCatch(OwnSequence):
    """Fails whatever its children raise."""

    def tick(self) -> Iterator[Behaviour]:
        try:
            yield from super().tick()
        except Exception:  # noqa: BLE001 - any
            self.finish(Status.FAILURE)
            yield self


@register("OwnShortcut", kind=Kind.DECORATOR)
class OwnShortcut(OwnInverter):
    """Has its child's answer without a tick."""

    def update(self) -> Status:
        return self.decorated.update()


@register("OwnHours", kind=Kind.DECORATOR)
class OwnHours(OwnTimeout):
    """Answers by how many whole hours it is."""

    def update(self) -> Status:
        return Status.SUCCESS if self.clock.now() // 3600 else Status.FAILURE


@register("OwnSharing", kind=Kind.DECORATOR)
class OwnSharing(OwnInverter):
    """Counts in two attributes that are one object."""

    def __init__(self, name: str, child: Behaviour) -> None:
        super().__init__(name, child)
        self.first = self.second = [0]

    def update(self) -> Status:
        self.first[0] = (self.first[0] + 1) % 3
        assert self.first == self.second
        return self.decorated.status


def wrong_number(_bound: object, children: list[int], _sure: bool) -> int:
    return children[7]


def no_number(*_: object) -> None:
    """Return what is no outcome set."""


@register("OwnSlip", kind=Kind.CONTROL, semantics=Semantics(wrong_number))  # type: ignore[arg-type]
class OwnSlip(OwnSequence):
    """Is described by a function that has a mistake."""


@register("OwnGap", kind=Kind.CONTROL, semantics=Semantics(no_number))  # type: ignore[arg-type]
class OwnGap(OwnSequence):
    """Is described by a function that returns nothing."""


@register("OwnForgetful", kind=Kind.DECORATOR)
class OwnForgetful(OwnInverter):
    """Answers with no status."""

    def update(self) -> Status:
        return None  # type: ignore[return-value]


@register("OwnLiar", kind=Kind.CONTROL, semantics=Semantics.sequence())
class OwnLiar(OwnFallback):
    """Is registered as a sequence, and is none."""


@register("OwnBoast", kind=Kind.DECORATOR, outcomes={Status.SUCCESS})
class OwnBoast(OwnInverter):
    """Is registered to succeed always."""


@register("OwnEndless", kind=Kind.DECORATOR)
class OwnEndless(OwnInverter):
    """Counts its ticks for ever."""

    ticks = 0

    def update(self) -> Status:
        self.ticks += 1
        return self.decorated.status


@register("OwnMemory", kind=Kind.CONTROL)
class OwnMemory(OwnSequence):
    """Answers by what its children show of their last tick."""

    def tick(self) -> Iterator[Behaviour]:
        first = self.children[0]
        skipped, tip = getattr(first, "skipped", False), first.tip()
        yield from (node for node in super().tick() if node is not self)
        if skipped or (tip is not None and tip.name == "B"):
            self.finish(Status.FAILURE)
        yield self


@register("OwnTwice", kind=Kind.CONTROL)
class OwnTwice(Own):
    """Ticks all of its children twice in a tick, with nothing but a loop to remember that, and counts their successes."""

    def tick(self) -> Iterator[Behaviour]:
        successes = 0
        for child in self.children * 2:
            yield from child.tick()
            successes += child.status == Status.SUCCESS
        self.finish(Status.SUCCESS if successes > len(self.children) else Status.RUNNING)
        yield self

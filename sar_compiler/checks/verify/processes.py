"""Processes that help with a search: each plays the ticks of some of the states at a distance.

They are copies of this one. Contents of entries have numbers that are given when they are seen first, so a copy is of
use as long as it meets nothing new; what it cannot say is found out here, and later copies know it. What the ticks
are, and so every answer, does not depend on who has played them.
"""

import contextlib
import gc
import marshal
import multiprocessing
import signal
from collections.abc import Iterator, Sequence
from multiprocessing.connection import Connection

from sar_compiler.checks.verify.stepping import TreeStepper
from sar_compiler.errors import UndecidableError
from sar_compiler.runtime.kernel.searching import Step

_BATCH = 64


class SearchProcesses:
    """Some copies of this process, made when they are needed first.

    Args:
        stepper: Plays the ticks.
        count: How many processes.
        many: How many states at the same distance are worth their help.
    """

    def __init__(self, stepper: TreeStepper, count: int, many: int = 512) -> None:
        self.many = many
        self._stepper = stepper
        self._count = count if count > 1 else 0
        self._known = -1
        self._connections: list[Connection] = []

    def steps_of(self, states: list[bytes]) -> Iterator[list[Step] | None]:
        """Yield for each state all of its steps; None for one that is left undone."""
        known = self._stepper.steps.known
        if known != self._known or not self._count:
            # Something new was met since the last time, so there will be more.
            self.close()
            self._known = known
            yield from [None] * len(states)
            return
        if not self._connections:
            self._start()
        batches = [states[first : first + _BATCH] for first in range(0, len(states), _BATCH)]
        for number, batch in enumerate(batches[: self._count]):
            self._send(number, batch)
        for number, batch in enumerate(batches):
            answers = self._receive(number)
            if number + self._count < len(batches):
                self._send(number, batches[number + self._count])
            yield from answers if answers is not None else [None] * len(batch)

    def close(self) -> None:
        """End the processes."""
        for connection in self._connections:
            connection.close()
        self._connections.clear()

    def _start(self) -> None:
        context = multiprocessing.get_context("fork")
        # What is there already is not looked at by the copies' collectors, so its memory remains shared.
        gc.freeze()
        for _ in range(self._count):
            here, there = context.Pipe()
            ours = [*self._connections, here]
            context.Process(target=_work, args=(there, ours, self._stepper), daemon=True).start()
            there.close()
            self._connections.append(here)
        gc.unfreeze()

    def _send(self, number: int, batch: Sequence[bytes]) -> None:
        # One that was killed takes nothing, and its answer will not come.
        with contextlib.suppress(OSError):
            self._connections[number % self._count].send_bytes(marshal.dumps(list(batch)))

    def _receive(self, number: int) -> list[list[Step] | None] | None:
        """Return an answer; None if the process was killed."""
        try:
            answers, ran = marshal.loads(self._connections[number % self._count].recv_bytes())  # noqa: S302 - our own copy
        except (OSError, EOFError):
            return None
        self._stepper.ran.update(ran)
        found: list[list[Step] | None] = answers
        return found


def _work(connection: Connection, others: Sequence[Connection], stepper: TreeStepper) -> None:
    """Answer for batches of states until nobody asks any more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for other in others:
        other.close()
    known = stepper.steps.known
    try:
        while True:
            batch = marshal.loads(connection.recv_bytes())  # noqa: S302 - from the process that this is a copy of
            stepper.ran.clear()
            answers = [_steps(stepper, state, known) for state in batch]
            connection.send_bytes(marshal.dumps((answers, list(stepper.ran))))
    except (OSError, EOFError):
        return


def _steps(stepper: TreeStepper, state: bytes, known: int) -> list[Step] | None:
    """Return the steps of a state; None if there is something new in them, or wrong."""
    steps, found = stepper.steps, []
    try:
        steps.enter(state)
        while steps.step():
            if steps.state is None or steps.known != known:
                return None
            found.append((steps.state, steps.waits, steps.broken))
    except UndecidableError:
        return None
    return found

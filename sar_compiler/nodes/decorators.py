"""Decorators: nodes with one child."""

import py_trees
from py_trees import decorators
from py_trees.common import Status

from sar_compiler.nodes.register import Registration
from sar_compiler.nodes.spec import Kind
from sar_compiler.runtime.clock import Clock


class Timeout(decorators.Timeout):
    """Fails if its child is still running after a time, measured on the mission's clock.

    py_trees' own Timeout reads the machine's clock, which is wrong for a robot on simulated time.

    Args:
        name: The node's name.
        child: The child.
        duration: How long the child may run, in seconds.
        clock: What the time is measured with.
    """

    def __init__(self, name: str, child: py_trees.behaviour.Behaviour, duration: float, clock: Clock) -> None:
        super().__init__(name=name, child=child, duration=duration)
        self._clock = clock
        self._deadline = 0.0

    def initialise(self) -> None:
        """Start the time."""
        self._deadline = self._clock.now() + self.duration
        self.feedback_message = ""

    def update(self) -> Status:
        """Pass the child's status on, or fail once the time is over."""
        remaining = self._deadline - self._clock.now()
        if self.decorated.status != Status.RUNNING:
            self.feedback_message = ""
            return self.decorated.status
        if remaining < 0.0:
            self.feedback_message = "timed out"
            return Status.FAILURE
        self.feedback_message = f"remaining: {remaining:.1f}s"
        return Status.RUNNING


_SUCCESS, _FAILURE, _RUNNING = "SUCCESS", "FAILURE", "RUNNING"
_ALL = frozenset({_SUCCESS, _FAILURE, _RUNNING})


def _decorator(
    cls: type[decorators.Decorator], doc: str, *outcomes: str, **parameter_docs: str
) -> Registration:
    return Registration(
        cls.__name__,
        cls,
        Kind.DECORATOR,
        frozenset(outcomes) or _ALL,
        doc=doc,
        parameter_docs={"name": "The node's name.", **parameter_docs},
    )


REGISTRATIONS = [
    _decorator(
        decorators.OneShot,
        "Lets its child finish once; from then on answers what the child answered, without ticking it.",
        policy="What counts as finished: any end, or only success.",
    ),
    _decorator(
        Timeout,
        "Fails if its child is still running after a time, measured on the mission's clock.",
        duration="How long the child may run, in seconds.",
    ),
    _decorator(
        decorators.Retry,
        "Ticks its child again after a failure, until it has failed too often.",
        num_failures="With how many failures to fail.",
    ),
    _decorator(
        decorators.Repeat,
        "Ticks its child again after a success, until it has succeeded often enough.",
        num_success="With how many successes to succeed.",
    ),
    _decorator(decorators.Inverter, "Turns success into failure and failure into success."),
    _decorator(decorators.SuccessIsRunning, "Turns success into running.", _FAILURE, _RUNNING),
    _decorator(decorators.SuccessIsFailure, "Turns success into failure.", _FAILURE, _RUNNING),
    _decorator(decorators.FailureIsSuccess, "Turns failure into success.", _SUCCESS, _RUNNING),
    _decorator(decorators.FailureIsRunning, "Turns failure into running.", _SUCCESS, _RUNNING),
    _decorator(decorators.RunningIsSuccess, "Turns running into success.", _SUCCESS, _FAILURE),
    _decorator(decorators.RunningIsFailure, "Turns running into failure.", _SUCCESS, _FAILURE),
]

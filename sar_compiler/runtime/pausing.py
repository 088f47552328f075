"""Pauses in the middle of a tick that a user's own methods do, in which all that it is in the middle of can be looked at."""

import types
from collections.abc import Callable, Iterator
from typing import Any, Final

from py_trees.behaviour import Behaviour
from py_trees.behaviours import Dummy
from py_trees.common import Status

from sar_compiler.errors import UndecidableError

PAUSE: Final[Behaviour] = Dummy("pause")
"""What a behaviour yields just before it is ticked; whoever ticks those around it takes it for one of the nodes below."""


class HalfTickError(UndecidableError):
    """A control begins to tick a child, and does not go on with it."""


class Called:
    """The methods of a behaviour below one that is ticked by its own methods.

    Args:
        behaviour: The behaviour.
        run: Ticks it.
        halt: Stops it with a status.
        fail: Is told what went wrong where nothing can be raised.
    """

    def __init__(
        self,
        behaviour: Behaviour,
        run: Callable[[], None],
        halt: Callable[[Status], None],
        fail: Callable[[UndecidableError], None],
    ) -> None:
        self._behaviour = behaviour
        self._run = run
        self._halt = halt
        self._fail = fail

    def tick(self) -> Iterator[Behaviour]:
        """Pause, tick the behaviour, and yield it."""
        try:
            yield PAUSE
        except GeneratorExit:
            message = f"what is around '{self._behaviour.name}' begins to tick it, and does not go on until that is done"
            self._fail(HalfTickError(message))
            raise
        self._run()
        yield self._behaviour

    def stop(self, new_status: Status = Status.INVALID) -> None:
        """Stop the behaviour."""
        self._halt(new_status)


def held_by(generator: Any) -> tuple[types.CodeType, int, tuple[str, ...], tuple[object, ...]]:
    """Return what a generator that pauses depends on: where it is, its variables, and what it goes through."""
    import gc

    frame = generator.gi_frame
    variables = frame.f_locals
    known = {id(each) for each in (frame, variables, frame.f_globals, frame.f_builtins, frame.f_code)}
    if frame.f_trace is not None:  # whoever watches: a debugger, a measurement of coverage
        known.add(id(frame.f_trace))
    held = [each for each in gc.get_referents(generator) if id(each) not in known]
    # Until Python 3.10 the frame holds them.
    held += [each for each in gc.get_referents(frame) if id(each) not in known]
    plain = tuple(each for each in held if not isinstance(each, (types.FrameType, types.CodeType)))
    return frame.f_code, frame.f_lasti, tuple(variables), plain

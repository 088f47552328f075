"""The hooks that Groot2 sets at the nodes of a tree, as JSON, while the tree is ticked: breakpoints, and overridden outcomes."""

import json
import threading
import time
from collections.abc import Callable, Generator
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, TypeVar

from py_trees.behaviour import Behaviour

from sar_compiler.errors import SarError
from sar_compiler.monitoring.numbered_tree import NumberedTree
from sar_compiler.runtime.kernel.cells import ENDED, SKIPPED, WORDS

# The statuses that can be asked for, as BehaviorTree.CPP writes them; only an end replaces anything.
_OUTCOMES = {word: number for number, word in enumerate(WORDS) if word}
_OUTCOMES["IDLE"] = SKIPPED
# What a request calls the kinds of values that a hook has.
_KINDS = {int: "a whole number", str: "a text", bool: "true or false"}

T = TypeVar("T")


class RequestError(SarError):
    """A request that cannot be answered; its text is the reply."""


class HookPosition(IntEnum):
    """Where a hook is."""

    BEFORE = 0
    AFTER = 1


class HookMode(IntEnum):
    """What a hook does."""

    BREAKPOINT = 0
    REPLACE = 1


@dataclass
class Hook:
    """A hook.

    Attributes:
        uid: The number of its node.
        position: Before the node's tick, or after it.
        mode: What it does.
        once: Whether it is removed when it has done it.
        outcome: What the tick is made to come to, as a number of `kernel.cells`; only SUCCESS and FAILURE change anything.
        enabled: Whether it does anything.
        ready: Whether its breakpoint is to be left.
        told: The outcome that it was told of last: what it does in every tick is said once.
    """

    uid: int
    position: HookPosition
    mode: HookMode
    once: bool
    outcome: int
    enabled: bool
    ready: bool = False
    told: int = SKIPPED

    @property
    def holds(self) -> bool:
        """Whether a tick that has reached it has to wait."""
        return self.mode is HookMode.BREAKPOINT and self.enabled and not self.ready

    def as_json(self) -> dict[str, object]:
        """Return it as the protocol has it."""
        return {
            "enabled": self.enabled,
            "uid": self.uid,
            "mode": int(self.mode),
            "once": self.once,
            "desired_status": WORDS[self.outcome],
            "position": int(self.position),
        }


class Groot2Hooks:
    """The hooks of a tree. What Groot2 asks for comes in one thread, and the tree is ticked in another.

    Args:
        tree: The tree.
        reached: Called with each hook that a tick comes to, in the thread that ticks.
        tell: Told in words what hooks do, in the thread that ticks.
        patience_sec: Without a request for so many seconds of the steady clock, nobody is there, and no hook does anything.
        who: Whose hooks they are, in words.

    Attributes:
        held: The hook at which a tick waits; None if none does.
        wake: Has the tree ticked soon, in its own thread; called from the other one.
    """

    def __init__(
        self,
        tree: NumberedTree,
        reached: Callable[[Hook], object],
        tell: Callable[[str], object],
        patience_sec: float,
        who: str = "Groot2",
    ) -> None:
        self._tree, self._who = tree, who
        self.held: Hook | None = None
        self.wake: Callable[[], object] = lambda: None
        self._reached, self._tell = reached, tell
        self._patience_sec = patience_sec
        self._hooks: dict[tuple[HookPosition, int], Hook] = {}
        self._lock = threading.Lock()
        self._heard = time.monotonic()
        self._is_alone = False

    def before(self, behaviour: Behaviour) -> Generator[None, None, int]:
        """Yield as long as a tick has to wait before a node; return the outcome to override, SKIPPED for none."""
        return (yield from self._pass(HookPosition.BEFORE, self._tree.uid_of_inner(behaviour)))

    def after(self, behaviour: Behaviour) -> Generator[None, None, int]:
        """Yield as long as a tick has to wait after a node; return the outcome to override, SKIPPED for none."""
        return (yield from self._pass(HookPosition.AFTER, self._tree.uid(behaviour)))

    def _pass(self, position: HookPosition, uid: int) -> Generator[None, None, int]:
        hook = self._hooks.get((position, uid))
        if hook is None or not hook.enabled:
            return SKIPPED
        name = self._tree.nodes[uid - 1].name
        self._reached(hook)
        if hook.holds:
            self.held = hook
            self._tell(
                f"{self._who} holds the tree {position.name.lower()} '{name}': it is not ticked until it goes on"
            )
            try:
                while hook.holds and self._hooks.get((position, uid)) is hook:
                    yield
            finally:
                self.held = None
            self._tell("the tree is ticked again")
        return self._leave(hook, name)

    def _leave(self, hook: Hook, name: str) -> int:
        """Leave a hook; return its overriding outcome, SKIPPED for none."""
        key = hook.position, hook.uid
        with self._lock:
            hook.ready = False
            if not hook.enabled or self._hooks.get(key) is not hook:
                return SKIPPED
            if hook.once:
                del self._hooks[key]
        if not hook.outcome & ENDED:
            return SKIPPED
        if hook.mode is HookMode.BREAKPOINT or hook.told != hook.outcome:
            hook.told = hook.outcome
            self._tell(f"{self._who} overrides the outcome of '{name}' with {WORDS[hook.outcome]}")
        return hook.outcome

    def heard(self) -> None:
        """Note that a request has come."""
        self._heard = time.monotonic()
        if self._is_alone:
            self._is_alone = False
            self.enable(enabled=True)

    def look(self) -> None:
        """See whether requests still come; if none does, no hook does anything until one does."""
        if not self._is_alone and time.monotonic() - self._heard > self._patience_sec:
            self._is_alone = True
            self.enable(enabled=False)

    def insert(self, text: str) -> None:
        """Insert a hook, or change it.

        Args:
            text: One as JSON, or a list of them.

        Raises:
            RequestError: If the text is none.
        """
        read = _parse_json(text)
        hooks = [_hook(each) for each in (read if isinstance(read, list) else [read])]
        with self._lock:
            for hook in hooks:
                there = self._hooks.get((hook.position, hook.uid))
                if there is not None:
                    # Who waits at a breakpoint waits on, unless it is none any more.
                    there.mode, there.once = hook.mode, hook.once
                    there.outcome, there.enabled = hook.outcome, hook.enabled
                elif self._tree.node(hook.uid) is not None:
                    self._hooks[hook.position, hook.uid] = hook
        self.wake()

    def remove(self, text: str) -> None:
        """Remove a hook; who waits at it goes on.

        Raises:
            RequestError: If there is none.
        """
        key = _key(_parse_json(text))
        with self._lock:
            if self._hooks.pop(key, None) is None:
                raise _not_found()
        self.wake()

    def unlock(self, text: str) -> None:
        """Have a breakpoint left, with an outcome or without.

        Raises:
            RequestError: If there is none.
        """
        read = _parse_json(text)
        key, remove = _key(read), _entry(read, "remove_when_done", bool)
        # Every other word, of whatever version, means to go on.
        outcome = _OUTCOMES.get(_entry(read, "desired_status", str), SKIPPED)
        with self._lock:
            hook = self._hooks.get(key)
            if hook is None:
                raise _not_found()
            hook.outcome = outcome if outcome & ENDED else SKIPPED
            hook.once |= remove
            hook.ready = hook.mode is HookMode.BREAKPOINT
        self.wake()

    def remove_all(self) -> None:
        """Remove all hooks."""
        with self._lock:
            self._hooks.clear()
        self.wake()

    def enable(self, *, enabled: bool) -> None:
        """Let all hooks do what they do, or nothing."""
        with self._lock:
            for hook in self._hooks.values():
                hook.enabled = enabled
        self.wake()

    def dump(self) -> str:
        """Return all hooks as JSON."""
        with self._lock:
            return json.dumps([hook.as_json() for hook in self._hooks.values()])


def _not_found() -> RequestError:
    return RequestError("Node ID not found")


def _parse_json(text: str) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise RequestError(f"not JSON: {error}") from error


def _hook(read: Any) -> Hook:
    position, uid = _key(read)
    mode = _member(read, "mode", HookMode)
    once, outcome = _entry(read, "once", bool), _outcome(read)
    return Hook(uid, position, mode, once, outcome, _entry(read, "enabled", bool))


def _key(read: Any) -> tuple[HookPosition, int]:
    uid = _entry(read, "uid", int)
    return _member(read, "position", HookPosition), uid


def _outcome(read: Any) -> int:
    word = _entry(read, "desired_status", str)
    if word not in _OUTCOMES:
        raise RequestError(f"desired_status: '{word}' is none of {', '.join(_OUTCOMES)}")
    return _OUTCOMES[word]


def _member(read: Any, name: str, kind: Any) -> Any:
    number = _entry(read, name, int)
    if number not in {*kind}:
        raise RequestError(f"{name}: {number} is none of {', '.join(str(int(each)) for each in kind)}")
    return kind(number)


def _entry(read: Any, name: str, kind: type[T]) -> T:
    value = read.get(name) if isinstance(read, dict) else None
    if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
        raise RequestError(f"a hook is an object with '{name}', {_KINDS[kind]}")
    return value

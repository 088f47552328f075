"""Which node of BehaviorTree.CPP does what a node of this project or of py_trees does."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeVar

from py_trees.common import OneShotPolicy

from sar_compiler.nodes.attributes import ONESHOT_TYPE
from sar_compiler.nodes.btcpp_notes import Notes
from sar_compiler.nodes.values import ConversionError, ValueType, blackboard_key, value_type_of
from sar_compiler.tree.model import Element

T = TypeVar("T")

ENDLESS = -1

HINTS = {
    "": "register a node of that name in C++",
    "FailureIsRunning": "an Inverter, a KeepRunningUntilFailure and an Inverter around its child do the same",
    "OneShot": "register a decorator OneShot in C++",
    "EternalGuard": "a ReactiveSequence of a ScriptCondition and its child does the same",
}
"""What to do about a node that BehaviorTree.CPP does not have."""


@dataclass
class Draft:
    """What a node is going to be.

    Attributes:
        element: The element that it is made of.
        tag: Which node it is.
        attributes: Its attributes, without the `ID` of the explicit form.
        explicit: Whether it is written in the explicit form.
        kept: Whether it stays as it is, because there is nothing like it or nothing to say about it.
        children: What is put into a leaf that becomes more than one node.
    """

    element: Element
    tag: str
    attributes: dict[str, str]
    explicit: bool
    kept: bool = False
    children: list[Element] = field(default_factory=list)

    def literal(self, name: str, wanted: type[T], notes: Notes) -> T | None:
        """Return the value of an attribute; None after a note, and then the node stays as it is."""
        text = self.attributes[name]
        try:
            if blackboard_key(text, name) is None:
                value = _type(wanted).convert(text)
                assert isinstance(value, wanted)  # noqa: S101 - of a type known here
                return value
            message = f"{name}: '{text}' is known when the robot starts, and must be known now"
            hint = f"write the value in place of '{text}'"
            notes.no_counterpart_of_value(self.element, name, message, hint)
        except ConversionError as error:
            notes.wrong_value(self.element, name, error)
        self.kept = True
        return None


Rule = Callable[[Draft, Notes], None]


def _renamed(tag: str) -> Rule:
    def rule(draft: Draft, _notes: Notes) -> None:
        draft.tag = tag

    return rule


def _by_memory(with_memory: str, without: str) -> Rule:
    def rule(draft: Draft, notes: Notes) -> None:
        memory = draft.literal("memory", bool, notes) if "memory" in draft.attributes else True
        if memory is not None:
            draft.attributes.pop("memory", None)
            draft.tag = with_memory if memory else without

    return rule


def _reactive(draft: Draft, notes: Notes) -> None:
    """Drop what the tag says already."""
    if "memory" in draft.attributes and draft.literal("memory", bool, notes) is False:
        del draft.attributes["memory"]


def _running(draft: Draft, _notes: Notes) -> None:
    element = draft.element
    draft.tag = "KeepRunningUntilFailure"
    draft.children = [Element("AlwaysSuccess", {}, (), element.source, element.line, element.column)]


def _oneshot(draft: Draft, notes: Notes) -> None:
    if "policy" not in draft.attributes:
        return
    try:
        policy = ONESHOT_TYPE.convert(draft.attributes["policy"])
    except ConversionError as error:
        notes.wrong_value(draft.element, "policy", error)
        return
    if policy is OneShotPolicy.ON_COMPLETION:
        draft.tag = "RunOnce"
        _replace(draft, "policy", "then_skip", "false")


def _retry(draft: Draft, notes: Notes) -> None:
    if _times(draft, "num_failures", "num_attempts", 1, notes):
        draft.tag = "RetryUntilSuccessful"
        message = "Retry waits for the next tick before each attempt; RetryUntilSuccessful may go on in the same one"
        notes.differs(draft.element, message)


def _repeat(draft: Draft, notes: Notes) -> None:
    # py_trees compares the number of successes with it, so that no success is the last one below 1.
    if "num_success" in draft.attributes and _times(draft, "num_success", "num_cycles", ENDLESS, notes):
        message = (
            "py_trees waits for the next tick before each repetition; num_cycles may go on in the same one"
        )
        notes.differs(draft.element, message)


def _times(draft: Draft, name: str, other: str, below_1: int, notes: Notes) -> bool:
    """Say a number of times in the other library's words; return whether it could be done."""
    if name not in draft.attributes:
        return False
    text = draft.attributes[name]
    if blackboard_key(text, name) is None:
        times = draft.literal(name, int, notes)
        if times is None:
            return False
        text = str(times if times >= 1 else below_1)
    _replace(draft, name, other, text)
    return True


def _timeout(draft: Draft, notes: Notes) -> None:
    if "duration" in draft.attributes:
        # For BehaviorTree.CPP no time at all means no limit.
        _milliseconds(draft, "msec", 1, notes)


def _timer(draft: Draft, notes: Notes) -> None:
    draft.attributes.setdefault("duration", "5.0")
    if _milliseconds(draft, "msec", 0, notes):
        draft.tag = "Sleep"


def _milliseconds(draft: Draft, other: str, least: int, notes: Notes) -> bool:
    text = draft.attributes["duration"]
    if blackboard_key(text, "duration") is not None:
        message = f"duration: '{text}' holds seconds, and BehaviorTree.CPP would read it as milliseconds"
        hint = f'give the mission a parameter in milliseconds, and write {other}="{{...}}"'
        notes.no_counterpart_of_value(draft.element, "duration", message, hint)
        draft.kept = True
        return False
    seconds = draft.literal("duration", float, notes)
    if seconds is None:
        return False
    _replace(draft, "duration", other, str(max(round(seconds * 1000.0), least)))
    return True


def _parallel(draft: Draft, notes: Notes) -> None:
    policy = draft.attributes.get("policy")
    if policy is None:
        return
    synchronise = draft.literal("synchronise", bool, notes) if "synchronise" in draft.attributes else True
    if policy not in ("SuccessOnAll", "SuccessOnOne") or (policy == "SuccessOnAll" and not synchronise):
        draft.kept = True
        detail = policy if policy != "SuccessOnAll" else f"{policy} without synchronise"
        message = f"policy: BehaviorTree.CPP's Parallel has nothing like {detail}"
        hint = "say it by success_count and failure_count, or register a control in C++"
        notes.no_counterpart_of_value(draft.element, "policy", message, hint)
    if draft.kept:
        return
    _replace(draft, "policy", "success_count", "1" if policy == "SuccessOnOne" else "-1")
    draft.attributes["failure_count"] = "1"
    draft.attributes.pop("synchronise", None)
    message = "py_trees ticks all children before it judges; BehaviorTree.CPP stops at the one that decides"
    notes.differs(draft.element, message)


def _replace(draft: Draft, name: str, other: str, text: str) -> None:
    """Put another attribute in the place of one."""
    draft.attributes = {
        (other if each == name else each): (text if each == name else value)
        for each, value in draft.attributes.items()
    }


def _type(python: type) -> ValueType:
    value_type = value_type_of(python)
    assert value_type is not None  # noqa: S101 - bool, int and float are known
    return value_type


RULES: dict[str, Rule] = {
    "Sequence": _by_memory("Sequence", "ReactiveSequence"),
    "Selector": _by_memory("Fallback", "ReactiveFallback"),
    "Fallback": _by_memory("Fallback", "ReactiveFallback"),
    "ReactiveSequence": _reactive,
    "ReactiveFallback": _reactive,
    "Parallel": _parallel,
    "Success": _renamed("AlwaysSuccess"),
    "Failure": _renamed("AlwaysFailure"),
    "Running": _running,
    "Timer": _timer,
    "FailureIsSuccess": _renamed("ForceSuccess"),
    "SuccessIsFailure": _renamed("ForceFailure"),
    "SuccessIsRunning": _renamed("KeepRunningUntilFailure"),
    "OneShot": _oneshot,
    "Retry": _retry,
    "Repeat": _repeat,
    "Timeout": _timeout,
}
"""By the tag: what makes a node of BehaviorTree.CPP of a draft, where its tag is not kept as it is."""

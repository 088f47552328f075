"""Conversion of nodes of this project and of py_trees to nodes of BehaviorTree.CPP."""

from collections.abc import Callable
from typing import TypeVar

from sar_compiler.nodes.binding.attributes import ONESHOT_TYPE
from sar_compiler.nodes.btcpp.draft import NodeDraft
from sar_compiler.nodes.collector import FindingCollector
from sar_compiler.nodes.values import SECONDS, ConversionError, blackboard_key
from sar_compiler.tree.model import Element

T = TypeVar("T")

ENDLESS = -1

NO_ONESHOT = "register a decorator OneShot in C++"
NO_FAILURE_IS_RUNNING = "wrap its child in an Inverter, a KeepRunningUntilFailure and an Inverter"


Rewrite = Callable[[NodeDraft, FindingCollector], None]


def rename(tag: str, draft: NodeDraft, _notes: FindingCollector) -> None:
    """Change only the tag."""
    draft.tag = tag


def select_tag_by_memory(with_memory: str, without: str, draft: NodeDraft, notes: FindingCollector) -> None:
    """Select the tag by the attribute `memory`, and remove the attribute."""
    memory = draft.literal("memory", bool, notes) if "memory" in draft.attributes else True
    if memory is not None:
        draft.attributes.pop("memory", None)
        draft.tag = with_memory if memory else without


def reactive(draft: NodeDraft, notes: FindingCollector) -> None:
    """Remove `memory="false"`, which the tag implies."""
    if "memory" in draft.attributes and draft.literal("memory", bool, notes) is False:
        del draft.attributes["memory"]


def rewrite_running(draft: NodeDraft, _notes: FindingCollector) -> None:
    """Rewrite `Running` as a succeeding node inside a decorator that never ends."""
    element = draft.element
    draft.tag = "KeepRunningUntilFailure"
    draft.children = [Element("AlwaysSuccess", {}, (), element.source, *element.position)]


def oneshot(draft: NodeDraft, notes: FindingCollector) -> None:
    """Rewrite `OneShot` as `RunOnce` if the policy of `OneShot` is `ON_COMPLETION`."""
    if "policy" not in draft.attributes:
        return
    try:
        policy = ONESHOT_TYPE.convert(draft.attributes["policy"])
    except ConversionError as error:
        notes.wrong_value(draft.element, "policy", error)
        return
    if policy == "ON_COMPLETION":
        draft.tag = "RunOnce"
        _replace(draft, "policy", "then_skip", "false")


def retry(draft: NodeDraft, notes: FindingCollector) -> None:
    """Rewrite `Retry` as `RetryUntilSuccessful`."""
    if _times(draft, "num_failures", "num_attempts", 1, notes):
        draft.tag = "RetryUntilSuccessful"
        message = "Retry waits for the next tick before each attempt, but RetryUntilSuccessful may continue in the same tick"
        notes.add("differs", message, draft.element)


def repeat(draft: NodeDraft, notes: FindingCollector) -> None:
    """Replace `num_success` by `num_cycles`."""
    # With num_success below 1, py_trees never succeeds, because it compares the number with the number of successes.
    if "num_success" in draft.attributes and _times(draft, "num_success", "num_cycles", ENDLESS, notes):
        message = "py_trees waits for the next tick before each repetition, but num_cycles may continue in the same tick"
        notes.add("differs", message, draft.element)


def _times(draft: NodeDraft, name: str, other: str, below_1: int, notes: FindingCollector) -> bool:
    """Rename an attribute that contains a number of rounds; return whether the number could be converted."""
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


def timeout(draft: NodeDraft, notes: FindingCollector) -> None:
    """Replace `duration` in seconds by `msec`."""
    if "duration" in draft.attributes:
        # BehaviorTree.CPP treats a time of zero as no limit.
        _milliseconds(draft, 1, notes)


def timer(draft: NodeDraft, notes: FindingCollector) -> None:
    """Rewrite `Timer` as `Sleep`."""
    draft.attributes.setdefault("duration", "5.0")
    if _milliseconds(draft, 0, notes):
        draft.tag = "Sleep"


def _milliseconds(draft: NodeDraft, least: int, notes: FindingCollector) -> bool:
    text = draft.attributes["duration"]
    if blackboard_key(text, "duration") is not None:
        message = f"duration: '{text}' is in seconds, but BehaviorTree.CPP would read milliseconds"
        hint = 'add a mission parameter in milliseconds, and write msec="{...}"'
        notes.add("no-counterpart", message, draft.element, value="duration", hint=hint)
        draft.kept = True
        return False
    seconds = draft.literal("duration", float, notes, SECONDS)
    if seconds is None:
        return False
    _replace(draft, "duration", "msec", str(max(round(seconds * 1000.0), least)))
    return True


def parallel(draft: NodeDraft, notes: FindingCollector) -> None:
    """Replace `policy` by `success_count` and `failure_count`."""
    policy = draft.attributes.get("policy")
    if policy is None:
        return
    synchronise = draft.literal("synchronise", bool, notes) if "synchronise" in draft.attributes else True
    if policy not in ("SuccessOnAll", "SuccessOnOne") or (policy == "SuccessOnAll" and not synchronise):
        draft.kept = True
        detail = policy if policy != "SuccessOnAll" else f"{policy} without synchronise"
        message = f"policy: BehaviorTree.CPP's Parallel has no counterpart for {detail}"
        hint = "use success_count and failure_count, or register a control in C++"
        notes.add("no-counterpart", message, draft.element, value="policy", hint=hint)
    if draft.kept:
        return
    _replace(draft, "policy", "success_count", "1" if policy == "SuccessOnOne" else "-1")
    draft.attributes["failure_count"] = "1"
    draft.attributes.pop("synchronise", None)
    message = (
        "py_trees ticks all children before it decides, but BehaviorTree.CPP stops at the decisive child"
    )
    notes.add("differs", message, draft.element)


def _replace(draft: NodeDraft, name: str, other: str, text: str) -> None:
    """Replace one attribute by another, at the same position."""
    draft.attributes = {
        (other if each == name else each): (text if each == name else value)
        for each, value in draft.attributes.items()
    }

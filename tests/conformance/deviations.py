"""Where this project differs from BehaviorTree.CPP on purpose, recognised by what happens."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Difference:
    """What first differs in a run.

    Attributes:
        run: The run, as BehaviorTree.CPP had it.
        tick: The tick, from 0; -1 if the tree was refused, or should have been.
        what: What differs: refused, accepted, events, root, or the path and key of an entry.
        expected: What BehaviorTree.CPP had.
        seen: What there is here.
        error: What was raised here.
    """

    run: Mapping[str, Any]
    tick: int
    what: str
    expected: str
    seen: str
    error: str = ""

    def __str__(self) -> str:
        """Say it in a line."""
        if self.what == "refused":
            return f"refused here: {self.seen}"
        if self.what == "accepted":
            return f"accepted here, refused there: {_line(self.expected)}"
        raised = f" ({_line(self.error)})" if self.error else ""
        return f"{self.run['mode']}, tick {self.tick}, {self.what}: {self.expected} there, {self.seen} here{raised}"


Case = Mapping[str, Any]
Rule = Callable[[Case, Difference], bool]


def deviation(case: Case, difference: Difference) -> str | None:
    """Return why a difference is intended; None if it is not."""
    return next((reason for reason, applies in _RULES if applies(case, difference)), None)


def _raised_there(difference: Difference) -> bool:
    return any(tick["root"] == "EXCEPTION" for tick in difference.run.get("ticks", ()))


def _refused_before(_: Case, difference: Difference) -> bool:
    return difference.what == "refused" and _raised_there(difference)


def _condition_skipped(case: Case, difference: Difference) -> bool:
    ticks = difference.run.get("ticks", ())
    exception = ticks[difference.tick].get("exception", "") if 0 <= difference.tick < len(ticks) else ""
    return ("IfThenElse" in exception or "WhileDoElse" in exception or "IDLE" in exception) and (
        "<IfThenElse" in case["xml"] or "<WhileDoElse" in case["xml"]
    )


def _precondition_checked_again(case: Case, difference: Difference) -> bool:
    earlier = [
        event for tick in difference.run.get("ticks", ())[: difference.tick + 1] for event in tick["events"]
    ]
    interrupted = any(event[0] in {"halt", "haltTree"} or "SKIPPED" in event for event in earlier)
    more = difference.expected.count("tick ") > difference.seen.count("tick ")
    return "<Precondition" in case["xml"] and difference.what == "events" and interrupted and more


def _time_over_skipped_child(case: Case, difference: Difference) -> bool:
    earlier = [
        event for tick in difference.run.get("ticks", ())[: difference.tick] for event in tick["events"]
    ]
    skipped = any("SKIPPED" in event for event in earlier)
    more = difference.seen.count("halt ") > difference.expected.count("halt ")
    return "<Timeout" in case["xml"] and difference.what == "events" and skipped and more


def _explicit_under_reactive(_: Case, difference: Difference) -> bool:
    return difference.what == "accepted" and "Unknown node type" in difference.expected


def _halting_scripts(case: Case, difference: Difference) -> bool:
    """Whether a script has, or has not, run when something was halted."""
    halts = any(
        event[0] in {"halt", "haltTree"}
        for tick in difference.run.get("ticks", ())[: difference.tick + 1]
        for event in tick["events"]
    )
    return halts and difference.what.startswith("blackboard")


def _post_on_halt(case: Case, difference: Difference) -> bool:
    return "_post=" in case["xml"] and _halting_scripts(case, difference)


def _halted_without_running(case: Case, difference: Difference) -> bool:
    return (
        "_onHalted=" in case["xml"] and bool(case.get("halt_before")) and _halting_scripts(case, difference)
    )


def _literal_kept(case: Case, difference: Difference) -> bool:
    lost = difference.what.startswith("blackboard") and difference.expected == "None"
    shown = difference.what == "events" and "<error>" in difference.expected
    return "<SetBlackboard" in case["xml"] and (lost or shown)


_RULES: tuple[tuple[str, Rule], ...] = (
    ("a mistake that is met while ticking there is refused before here", _refused_before),
    ("IfThenElse and WhileDoElse raise there over a condition that is skipped", _condition_skipped),
    ("Precondition does not check there after its child was halted or skipped", _precondition_checked_again),
    (
        "Timeout never comes there if its time runs out over a child that was skipped",
        _time_over_skipped_child,
    ),
    ("explicit nodes under ReactiveSequence are refused there", _explicit_under_reactive),
    ("_post is not run there when a node is halted, against the documentation", _post_on_halt),
    ("halting the tree runs _onHalted there of nodes that do not run", _halted_without_running),
    ("SetBlackboard can lose a literal there", _literal_kept),
)


def _line(text: str) -> str:
    return " ".join(text.split())

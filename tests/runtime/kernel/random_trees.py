"""Random trees of all nodes of the library, as the text of files that the compiler reads."""

import itertools
import random
from collections.abc import Callable

from py_trees import decorators

from sar_compiler.nodes.spec import Kind, NodeSpec
from sar_compiler.runtime.parents import EngineParent
from tests.node_forms import forms
from tests.trees import class_of

Attributes = dict[str, dict[str, object]]
"""The attributes of each tag."""

HAS_FOR_EACH = hasattr(decorators, "ForEach")
"""Whether py_trees has ForEach, which was added in 2.4."""
_KEYS = ("a", "b", "n")
_CONDITIONS = {
    "_failureIf": ("n == 1", "a > 1", "false"),
    "_successIf": ("n == 2", "a == 1", "false"),
    "_skipIf": ("n == 0", "b == 1"),
    "_while": ("n != 3", "a != 2"),
    "_onSuccess": ("a := 1", "n := n == 3 ? 0 : n + 1"),
    "_onFailure": ("b := 1", "a := 2"),
    "_onHalted": ("b := 0", "n := 3"),
    "_post": ("a := 0", "n := 1"),
}
_SKIPPING = ("_skipIf", "_while")
FORMS = [form for form in forms() if not any("{" in text or "v ==" in text for _, text in form.attributes)]


def knows_skips(spec: NodeSpec) -> bool:
    """Return whether a node supports skipped children."""
    cls = class_of(spec)
    return (cls is not None and issubclass(cls, EngineParent)) or spec.skipping.replacement is not None


class RandomTree:
    """Writes one tree.

    Args:
        seed: The seed of the random choices.
        skips: Whether nodes can be skipped. Parents of py_trees do not support that, so the tree then contains none.
    """

    def __init__(self, seed: int, *, skips: bool) -> None:
        self.draw = random.Random(seed)  # noqa: S311 - the same trees in every run
        self.skips = skips
        self.numbers = itertools.count()

    def text(self) -> str:
        main, inner = self.node(0), self.node(2)
        return (
            '<root BTCPP_format="4" main_tree_to_execute="Main">\n'
            f'<BehaviorTree ID="Main">{main}</BehaviorTree>\n'
            f'<BehaviorTree ID="Inner">{inner}</BehaviorTree>\n</root>\n'
        )

    def node(self, depth: int) -> str:
        kinds = (
            (self.leaf,)
            if depth > 3
            else (self.leaf, self.control, self.control, self.decorator, self.decorator)
        )
        return self.draw.choice(kinds)(depth)

    def element(self, tag: str, inner: str = "", **attributes: object) -> str:
        written = {"name": f"{tag}{next(self.numbers)}", **attributes}
        if self.draw.random() < 0.15:
            name = self.draw.choice([name for name in _CONDITIONS if self.skips or name not in _SKIPPING])
            written[name] = self.draw.choice(_CONDITIONS[name]).replace(">", "&gt;")
        if not self.skips and self.draw.random() < 0.07:
            written["oneshot"] = self.draw.choice(("ON_COMPLETION", "ON_SUCCESSFUL_COMPLETION"))
        texts = " ".join(
            f'{name}="{str(value).lower() if isinstance(value, bool) else value}"'
            for name, value in written.items()
        )
        return f"<{tag} {texts}>{inner}</{tag}>\n" if inner else f"<{tag} {texts}/>\n"

    def leaf(self, depth: int) -> str:
        draw = self.draw
        probe = "Skipper" if self.skips else "Probe"
        if draw.random() < 0.6:
            return self.element(probe)
        key = draw.choice(_KEYS)
        made: tuple[Callable[[], str], ...] = (
            lambda: self.element("Script", code=draw.choice(("n += 1", "a := n", "b := 1 - b", "n := 0"))),
            lambda: self.element("ScriptCondition", code=draw.choice(("n == 2", "a != b", "b == 1"))),
            lambda: self.element("SetBlackboard", value=draw.choice(("1", "{a}", "{b}")), output_key=key),
            lambda: self.element("UnsetBlackboard", key="b"),
            lambda: self.element("WasEntryUpdated", entry=f"{{{key}}}"),
            lambda: self.element(draw.choice(("AlwaysSuccess", "AlwaysFailure", "Running"))),
            lambda: self.element("Sleep", msec=draw.choice((0, 125, 250, 375))),
            lambda: self.element("Timer", duration=draw.choice((0, 0.25))),
            lambda: self.element("StatusQueue", queue="RUNNING;SUCCESS;FAILURE;RUNNING;SUCCESS"),
            lambda: self.element("StatusQueue", queue="RUNNING;FAILURE", eventually="SUCCESS"),
            lambda: self.element("Periodic", n=draw.choice((0, 1, 2))),
            lambda: self.element("SuccessEveryN", n=draw.choice((1, 2, -3))),
            lambda: self.element("TickCounter", duration=draw.choice((0, 1, 3)), completion_status="FAILURE"),
            lambda: self.element("SubTree", ID="Inner") if depth < 2 else self.element(probe),
        )
        return draw.choice(made)()

    def children(self, depth: int, least: int, most: int) -> str:
        return "".join(self.node(depth + 1) for _ in range(self.draw.randint(least, most)))

    def control(self, depth: int) -> str:
        draw = self.draw
        tags = (
            "Sequence",
            "Fallback",
            "Selector",
            "Sequence",
            "Fallback",
            "AsyncSequence",
            "AsyncFallback",
            "SequenceWithMemory",
        )
        some = self.children(depth, 1, 4)
        made: list[Callable[[], str]] = [
            *(lambda tag=tag: self.element(tag, some) for tag in tags),
            *(lambda tag=tag: self.element(tag, some, memory=draw.random() < 0.5) for tag in tags[:3]),
            lambda: self.element("ReactiveSequence", some),
            lambda: self.element("ReactiveFallback", some),
            lambda: self.element(
                "Parallel",
                self.children(depth, 2, 3),
                success_count=draw.choice((1, 2, -1, -2)),
                failure_count=draw.choice((1, 2, -1)),
            ),
            lambda: self.element(
                "ParallelAll", self.children(depth, 2, 3), max_failures=draw.choice((0, 1, 2, -1))
            ),
            lambda: self.element("IfThenElse", self.children(depth, 2, 3)),
            lambda: self.element("WhileDoElse", self.children(depth, 2, 3)),
            lambda: self.switch(depth, draw.randint(2, 6)),
            lambda: self.element("TryCatch", self.children(depth, 2, 4), catch_on_halt=draw.random() < 0.5),
        ]
        if not self.skips:
            made += [
                lambda: self.element(
                    "Parallel", some, policy="SuccessOnAll", synchronise=draw.random() < 0.5
                ),
                lambda: self.element("Parallel", some, policy="SuccessOnOne"),
                lambda: self.element(
                    "Parallel",
                    "".join(self.element("Probe", name=name) for name in ("left", "middle", "right")),
                    policy="SuccessOnSelected",
                    selected=draw.choice(("left", "middle;left", "right;middle")),
                    synchronise=draw.random() < 0.5,
                ),
            ]
        return draw.choice([*made, lambda: self.any_form(Kind.CONTROL, depth)])()

    def any_form(self, kind: Kind, depth: int) -> str:
        """Return any node of a kind, including those that this module does not name."""
        forms = [
            form for form in FORMS if form.spec.kind is kind and (not self.skips or knows_skips(form.spec))
        ]
        form = self.draw.choice(forms)
        count = form.count(2)
        return self.element(form.spec.tag, self.children(depth, count, count), **dict(form.attributes))

    def switch(self, depth: int, cases: int) -> str:
        names = {f"case_{number}": number for number in range(1, cases + 1)}
        return self.element(
            f"Switch{cases}", self.children(depth, cases + 1, cases + 1), variable="{n}", **names
        )

    def decorator(self, depth: int) -> str:
        if self.draw.random() < 0.1:
            return self.any_form(Kind.DECORATOR, depth)
        child = self.node(depth + 1)
        tags = {**self.repeating(), **(self.skipping() if self.skips else self.stock())}
        tag = self.draw.choice(sorted(tags))
        attributes = tags[tag]
        if not self.skips and self.draw.random() < 0.5:
            attributes = self.of_py_trees().get(tag, attributes)
        return self.element(tag, child, **attributes)

    def repeating(self) -> Attributes:
        """Return decorators that can be used with and without skips."""
        draw = self.draw
        return {
            "Inverter": {},
            "ForceSuccess": {},
            "ForceFailure": {},
            "KeepRunningUntilFailure": {},
            "Repeat": {"num_cycles": draw.choice((-1, 0, 1, 2, 3, "{n}"))},
            "RetryUntilSuccessful": {"num_attempts": draw.choice((-1, 0, 1, 2, 3, "{n}"))},
            "Delay": {"delay_msec": draw.choice((0, 125, 250))},
            "Timeout": {"msec": draw.choice((0, 125, 250))},
            "WaitValueUpdate": {"entry": self.key()},
        }

    def skipping(self) -> Attributes:
        """Return decorators that can be skipped."""
        draw = self.draw
        return {
            "RunOnce": {"then_skip": draw.random() < 0.5},
            "Precondition": {
                "if": "n != 1",
                "else": draw.choice(("FAILURE", "SUCCESS", "RUNNING", "SKIPPED")),
            },
            "SkipUnlessUpdated": {"entry": self.key()},
            "LoopInt": {
                "queue": "1;2;3",
                "value": "{n}",
                "if_empty": draw.choice(("SUCCESS", "FAILURE", "SKIPPED")),
            },
            "LoopDouble": {"queue": "{numbers}", "value": "{x}"},
            "LoopBool": {"queue": "{flags}", "value": "{flag}"},
            "LoopString": {"queue": "x;y", "value": "{text}"},
        }

    def stock(self) -> Attributes:
        """Return decorators of py_trees, which do not support skips."""
        draw = self.draw
        return {
            "OneShot": {"policy": draw.choice(("ON_COMPLETION", "ON_SUCCESSFUL_COMPLETION"))},
            "Retry": {"num_failures": draw.choice((0, 1, 2, 3))},
            "Condition": {"status": draw.choice(("SUCCESS", "FAILURE", "RUNNING"))},
            "Count": {},
            "EternalGuard": {"condition": draw.choice(("n != 2", "n == 0", "b == 1", "a != 2"))},
            "PassThrough": {},
            "StatusToBlackboard": {"variable_name": "status"},
            **({"ForEach": {"source_key": "items", "target_key": "item"}} if HAS_FOR_EACH else {}),
            "SuccessIsRunning": {},
            "SuccessIsFailure": {},
            "FailureIsSuccess": {},
            "FailureIsRunning": {},
            "RunningIsSuccess": {},
            "RunningIsFailure": {},
        }

    def of_py_trees(self) -> Attributes:
        """Return py_trees' attributes for the tags that both libraries have."""
        return {"Repeat": {"num_success": self.draw.choice((0, 1, 2))}, "Timeout": {"duration": 0.25}}

    def key(self) -> str:
        return f"{{{self.draw.choice(_KEYS)}}}"

"""Controls: nodes with several children."""

from typing import Literal

from py_trees import composites
from py_trees.behaviour import Behaviour
from py_trees.common import ParallelPolicy
from py_trees.decorators import OneShot

from sar_compiler.nodes.register import Registration
from sar_compiler.nodes.spec import Kind, Skips
from sar_compiler.nodes.values import nearest
from sar_compiler.runtime import branches, controls, parallel
from sar_compiler.runtime.conditions import Conditions

_ALL = frozenset({"SUCCESS", "FAILURE", "RUNNING"})

_SEQUENCE = "Ticks its children in order until one does not succeed; succeeds when all have."
_SELECTOR = "Ticks its children in order until one does not fail; fails when all have."
_REACTIVE = "Looks at every child again in every tick."
_PAUSES = "Lets the rest of the robot have a turn after every child."

_PARAMETER_DOCS = {
    "name": "The node's name.",
    "memory": "Whether to go on with the child that was running (true), or to look at every child again (false).",
}


def _ordered(tag: str, cls: type, skip_cls: type, doc: str, memory: bool | None) -> Registration:
    """Return a sequence or selector; *memory* is what its tag says, None where it is an attribute."""
    return Registration(
        tag,
        cls,
        Kind.CONTROL,
        _ALL,
        doc=doc,
        defaults={"memory": True} if memory is None else {},
        fixed={} if memory is None else {"memory": memory},
        parameter_docs=_PARAMETER_DOCS,
        skips=Skips.FROM_CHILD,
        skip_cls=skip_cls,
    )


def _own(tag: str, cls: type, **more: object) -> Registration:
    """Return a control of BehaviorTree.CPP's that py_trees does not have."""
    return Registration(tag, cls, Kind.CONTROL, _ALL, skips=Skips.FROM_CHILD, **more)  # type: ignore[arg-type]


def _switch(cases: int) -> Registration:
    names = [f"case_{number}" for number in range(1, 7)]
    return _own(
        f"Switch{cases}",
        branches.Switch,
        hidden=frozenset(names[cases:]),
        required=frozenset(names[:cases]),
        child_count=(cases + 1, cases + 1),
    )


def stock_parallel(
    name: str,
    children: list[Behaviour],
    policy: Literal["SuccessOnAll", "SuccessOnOne", "SuccessOnSelected"],
    synchronise: bool | None = None,
    selected: list[str] | None = None,
) -> composites.Parallel:
    """Ticks all its children in every tick; fails as soon as one of them does.

    Args:
        name: The node's name.
        children: The children.
        policy: Which children have to succeed; those still running then are interrupted.
        synchronise: Whether a child that has succeeded waits for the others, instead of being started again; not
            for `SuccessOnOne`. Where it is not written, it does.
        selected: The names of the children that have to succeed, for `SuccessOnSelected`: `left;right`.

    Raises:
        ValueError: If a name is not that of one child, or an attribute does not go with the policy.
    """
    if selected is not None and policy != "SuccessOnSelected":
        message = f"selected: goes with the policy SuccessOnSelected, not with {policy}"
        raise ValueError(message)
    if policy == "SuccessOnOne":
        if synchronise:
            message = "synchronise: with SuccessOnOne no child waits for another; leave it out"
            raise ValueError(message)
        return composites.Parallel(name, ParallelPolicy.SuccessOnOne(), children)
    waits = synchronise is not False
    if policy == "SuccessOnAll":
        return composites.Parallel(name, ParallelPolicy.SuccessOnAll(waits), children)
    chosen = [_child_called(text.strip(), children) for text in selected or []]
    if not chosen:
        message = (
            "selected: SuccessOnSelected needs the names of the children that have to succeed: left;right"
        )
        raise ValueError(message)
    return composites.Parallel(name, ParallelPolicy.SuccessOnSelected(chosen, waits), children)


def _child_called(name: str, children: list[Behaviour]) -> Behaviour:
    """Return the child that is called by a name, with what the compiler has wrapped around it."""
    found = [child for child in children if _written_name(child) == name]
    if len(found) == 1:
        return found[0]
    names = [_written_name(child) for child in children]
    if found:
        message = f"selected: {len(found)} children are called '{name}'; give each a name of its own"
    else:
        near = nearest(name, names)
        advice = f"did you mean '{near}'?" if near else f"there are {', '.join(names)}"
        message = f"selected: no child is called '{name}'; {advice}"
    raise ValueError(message)


def _written_name(child: Behaviour) -> str:
    """Return a child's name as the file has it: without what `oneshot` and conditions have wrapped around it."""
    if isinstance(child, Conditions):
        return child.decorated.name
    if isinstance(child, OneShot):
        inner = _written_name(child.decorated)
        return inner if child.name == f"{inner}OneShot" else child.name
    return child.name


REGISTRATIONS = [
    _ordered("Sequence", composites.Sequence, controls.Sequence, _SEQUENCE, None),
    _ordered("Selector", composites.Selector, controls.Fallback, _SELECTOR, None),
    _ordered("Fallback", composites.Selector, controls.Fallback, _SELECTOR, None),
    _ordered(
        "ReactiveSequence", composites.Sequence, controls.Sequence, f"{_SEQUENCE} {_REACTIVE}", memory=False
    ),
    _ordered(
        "ReactiveFallback", composites.Selector, controls.Fallback, f"{_SELECTOR} {_REACTIVE}", memory=False
    ),
    _own("AsyncSequence", controls.AsyncSequence, doc=f"{_SEQUENCE} {_PAUSES}"),
    _own("AsyncFallback", controls.AsyncFallback, doc=f"{_SELECTOR} {_PAUSES}"),
    _own("SequenceWithMemory", controls.SequenceWithMemory),
    _own(
        "Parallel",
        parallel.Parallel,
        defaults={"success_count": -1, "failure_count": 1},
    ),
    Registration(
        "Parallel",
        composites.Parallel,
        Kind.CONTROL,
        _ALL,
        factory=stock_parallel,
        skip_advice='success_count="..."',
        variant=True,
    ),
    _own("ParallelAll", parallel.ParallelAll, defaults={"max_failures": 1}),
    _own("IfThenElse", branches.IfThenElse, child_count=(2, 3)),
    _own("WhileDoElse", branches.WhileDoElse, child_count=(2, 3)),
    *(_switch(cases) for cases in range(2, 7)),
    _own("TryCatch", branches.TryCatch, child_count=(2, None), defaults={"catch_on_halt": False}),
]

"""Unused trees, and keys that are passed to subtrees but not used there."""

from collections.abc import Iterator, Mapping
from dataclasses import replace

from sar_compiler.checks.rules.check_context import CheckContext, warning
from sar_compiler.checks.rules.key_accesses import KeyAccesses
from sar_compiler.nodes.binding.attributes import underscored
from sar_compiler.nodes.binding.bound import BoundNode, BoundTree
from sar_compiler.nodes.binding.nesting import trees_in
from sar_compiler.nodes.spec import Direction
from sar_compiler.nodes.values import listed
from sar_compiler.tree.diagnostic import Cause, Diagnostic, Severity


def check_subtrees(context: CheckContext) -> Iterator[Diagnostic]:
    """Yield trees that are used by no other, and attributes of `SubTree` that the tree does not use."""
    if not context.sound:
        return  # a mistake in a tree may be the reason why it does not use a key, or another tree
    yield from _unused_trees(context)
    wanted = _Wanted(context.key_accesses)
    for tree in context.trees:
        for use in tree.uses:
            yield from _unused_arguments(use, context, wanted)
            yield from _texts_of_outputs(use, context)


def _unused_trees(context: CheckContext) -> Iterator[Diagnostic]:
    main = context.forest.main_tree()
    mains = [tree for tree in context.bound.trees if tree.element is main]
    if not mains or context.forest.main.main_tree_name is None:
        return
    used = set(trees_in(mains[0]))
    # Unused trees may use each other: only the outermost one is reported.
    inner = {node.subtree for tree in context.bound.trees for node in tree.subtrees()}
    for tree in context.bound.trees:
        element = tree.element
        is_own = element.source is context.forest.main.source
        if (
            is_own
            and tree not in used
            and tree not in inner
            and context.forest.trees.get(tree.name) is element
            and not context.forest.is_used_elsewhere(tree.name)
        ):
            message = (
                f"the tree '{tree.name}' is never ticked: it is neither in '{mains[0].name}' nor in any other"
            )
            hint = f'put it somewhere, <SubTree ID="{tree.name}"/>, or delete it'
            span = element.value_span("ID")
            yield Diagnostic(
                "unused-tree", message, element.source, span, hint=hint, severity=Severity.WARNING
            )


class _Wanted:
    """The keys that each tree uses."""

    def __init__(self, accesses: Mapping[BoundTree, KeyAccesses]) -> None:
        self._accesses = accesses
        self._known: dict[BoundTree, frozenset[str] | None] = {}

    def by(self, tree: BoundTree) -> frozenset[str] | None:
        """Return the keys; None if a node may access any key."""
        if tree not in self._known:
            self._known[tree] = self._keys(tree)
        return self._known[tree]

    def _keys(self, tree: BoundTree) -> frozenset[str] | None:
        accesses = self._accesses[tree]
        if accesses.is_open:
            return None
        keys = set(accesses.keys)
        for use in tree.subtrees():
            keys.update(use.remapping.keys.values())
            inner = (
                self.by(use.subtree) if use.subtree is not None and use.remapping.autoremap else frozenset()
            )
            if inner is None:
                return None
            keys.update(inner)
        return frozenset(keys)


def _texts_of_outputs(use: BoundNode, context: CheckContext) -> Iterator[Diagnostic]:
    """Yield texts in place of the keys that a tree writes to, as its model says."""
    model = context.bound.models.subtrees.get(use.element.attributes.get("ID", ""))
    for port in model.ports.values() if model is not None else ():
        text = use.element.attributes.get(port.name)
        if text is not None and port.direction is Direction.OUTPUT and port.name in use.remapping.constants:
            message = f"{port.name}: an output is written to the blackboard, and '{text}' is no key of it"
            suggestion = f"{{{text}}}" if text.isidentifier() else None
            span, hint = use.element.value_span(port.name), f'write {port.name}="{{key}}"'
            yield warning("unwritten-key", message, use, span, suggestion, hint)


def _unused_arguments(use: BoundNode, context: CheckContext, wanted: _Wanted) -> Iterator[Diagnostic]:
    tree = use.subtree
    if tree is None:
        yield from _undeclared_arguments(use, context)
        return
    keys = wanted.by(tree)
    if keys is None:
        return
    model = context.bound.models.subtrees.get(tree.name)
    declared = model.ports if model is not None else ()
    given = {*use.remapping.keys, *use.remapping.constants}
    unused = [
        name for name in use.element.attributes if name in given and name not in keys and name not in declared
    ]
    if not unused:
        return
    missing = sorted(key for key in keys if key not in given and not key.startswith("@"))
    hint = f"it uses {listed(missing)}" if missing else "delete it"
    for name in unused:
        message = f"{name}: the tree '{tree.name}' does nothing with this key"
        near = "_autoremap" if name == "autoremap" else underscored(name)
        near = near or context.guesses.nearest(name, missing)
        cause = Cause(f"the tree '{tree.name}' does nothing with these keys", name)
        found = warning("unused-argument", message, use, use.element.name_span(name), near, hint)
        yield found if near else replace(found, common_cause=cause)


def _undeclared_arguments(use: BoundNode, context: CheckContext) -> Iterator[Diagnostic]:
    """Yield keys passed to a tree that only a model describes, and that the model does not have."""
    model = context.bound.models.subtrees.get(use.spec.tag)
    if model is None or not model.ports:  # one without ports may just say that there is such a tree
        return
    for name in [*use.remapping.keys, *use.remapping.constants]:
        if name not in model.ports:
            message = f"{name}: the model of the tree '{model.tag}' has no such port"
            near = context.guesses.nearest(name, model.ports)
            hint = f"it has {listed(model.ports)}"
            yield warning("unused-argument", message, use, use.element.name_span(name), near, hint)

"""Rules about unused trees, and about keys that are passed to a subtree that does not use them."""

import functools
import itertools
from collections.abc import Callable, Iterator, Mapping

from sar_compiler.checks.rules import CheckContext
from sar_compiler.checks.rules.entry_accesses import KeyAccesses
from sar_compiler.nodes.binding.attributes import intended_condition
from sar_compiler.nodes.binding.bound import BoundNode, BoundTree
from sar_compiler.nodes.binding.nesting import trees_in
from sar_compiler.nodes.collector import text_of_output
from sar_compiler.nodes.spec import Direction
from sar_compiler.nodes.values import join_with_commas
from sar_compiler.runtime.expressions import ComparisonChain, Literal, Name, children, parts
from sar_compiler.tree.diagnostic import Advice, Cause, Diagnostic

_KeysOf = Callable[[BoundTree], frozenset[str] | None]


def check_subtrees(context: CheckContext) -> Iterator[Diagnostic]:
    """Yield findings about unused trees, and about `SubTree` attributes that do not match the tree's keys."""
    compared = functools.cache(_compared_strings)
    for tree in context.trees:
        yield from _keys_as_strings(tree, context, compared)
    if not context.is_complete:
        return  # because of an error, a tree may seem not to use a key or another tree
    yield from _unused_trees(context)
    keys_of = _keys_of_trees(context.key_accesses)
    for tree in context.trees:
        for use in tree.uses:
            yield from _unused_arguments(use, context, keys_of)
            yield from _strings_for_outputs(use, context)
        yield from _unused_ports(tree, context, keys_of(tree))


def _unused_ports(
    tree: BoundTree, context: CheckContext, keys: frozenset[str] | None
) -> Iterator[Diagnostic]:
    """Yield findings about ports that a tree's model declares but the tree does not use."""
    model = context.bound_forest.models.subtrees.get(tree.name)
    if model is None or keys is None or context.forest.trees.get(tree.name) is not tree.element:
        return
    for port in model.ports.values():
        if port.name not in keys:
            free = sorted(key for key in keys if key not in model.ports and not key.startswith("@"))
            near = context.guesses.nearest(port.name, free)
            message = f"the tree '{tree.name}' does not use the port '{port.name}' of its model"
            hint = f"it uses {join_with_commas(free)}" if free else "delete it"
            yield port.element.finding("model-mismatch", message, value="name", suggestion=near, hint=hint)


def _unused_trees(context: CheckContext) -> Iterator[Diagnostic]:
    main = context.forest.main_tree()
    mains = [tree for tree in context.bound_forest.trees if tree.element is main]
    if not mains or context.forest.main.main_tree_name is None:
        return
    used = set(trees_in(mains[0]))
    # Unused trees may use each other. Only the outermost tree is reported.
    inner = {node.subtree for tree in context.bound_forest.trees for node in tree.subtrees()}
    for tree in context.bound_forest.trees:
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
                f"the tree '{tree.name}' is never ticked: neither '{mains[0].name}' nor another tree uses it"
            )
            hint = f'use the tree in <SubTree ID="{tree.name}"/>, or delete it'
            yield element.finding("unused-tree", message, value="ID", hint=hint)


def _keys_as_strings(
    tree: BoundTree, context: CheckContext, compared: Callable[[BoundTree], frozenset[tuple[str, object]]]
) -> Iterator[Diagnostic]:
    """Yield findings about string arguments that equal a key of the outer tree.

    In BehaviorTree.CPP 3, keys were passed to subtrees without braces.
    """
    given = [(use, name, text) for use in tree.uses for name, text in use.remapping.constants.items()]
    if not given:
        return
    keys = set(context.key_accesses[tree].keys)
    keys.update(key for use in tree.uses for key in use.remapping.keys.values())
    for use, name, text in given:
        model = context.bound_forest.models.subtrees.get(use.element.attributes.get("ID", ""))
        port = model.ports.get(name) if model is not None else None
        if text not in keys or (port is not None and port.direction is Direction.OUTPUT):
            continue
        if use.subtree is None or (
            name in context.key_accesses[use.subtree].keys and (name, text) not in compared(use.subtree)
        ):
            message = f"{name}: '{text}' is a string, but '{tree.name}' has a key of this name"
            hint = f'write {name}="{{{text}}}", unless you mean the string'
            cause = Cause("strings that are also keys of the outer tree are passed to subtrees", text)
            advice = Advice(suggestion=f"{{{text}}}", hint=hint, common_cause=cause)
            yield use.element.finding("key-as-text", message, value=name, **advice)


def _compared_strings(tree: BoundTree) -> frozenset[tuple[str, object]]:
    """Return the pairs of a key and a string that a tree's scripts compare.

    These strings are valid arguments.
    """
    scripts = (script for node in tree.scripted for _, script in node.scripts())
    statements = (each for script in scripts for each in script.statements)
    return frozenset(
        (name.name, literal.value)
        for part in itertools.chain.from_iterable(map(parts, statements))
        if isinstance(part, ComparisonChain)
        for sides in itertools.pairwise(children(part))
        for name, literal in (sides, sides[::-1])
        if isinstance(name, Name) and isinstance(literal, Literal)
    )


def _keys_of_trees(accesses: Mapping[BoundTree, KeyAccesses]) -> _KeysOf:
    """Return a function that maps a tree to the keys that it uses, or to None if it may access any key."""

    @functools.cache
    def keys_of(tree: BoundTree) -> frozenset[str] | None:
        if accesses[tree].is_open:
            return None
        keys = set(accesses[tree].keys)
        for use in tree.subtrees():
            keys.update(use.remapping.keys.values())
            if use.subtree is not None and use.remapping.autoremap:
                inner = keys_of(use.subtree)
                if inner is None:
                    return None
                keys.update(inner)
        return frozenset(keys)

    return keys_of


def _strings_for_outputs(use: BoundNode, context: CheckContext) -> Iterator[Diagnostic]:
    """Yield findings about strings that are passed to a tree's output ports instead of keys."""
    model = context.bound_forest.models.subtrees.get(use.element.attributes.get("ID", ""))
    for port in model.ports.values() if model is not None else ():
        text = use.element.attributes.get(port.name)
        if text is not None and port.direction is Direction.OUTPUT and port.name in use.remapping.constants:
            yield text_of_output("unwritten-key", use.element, port.name, text)


def _unused_arguments(use: BoundNode, context: CheckContext, keys_of: _KeysOf) -> Iterator[Diagnostic]:
    tree = use.subtree
    if tree is None:
        yield from _undeclared_arguments(use, context)
        return
    keys = keys_of(tree)
    if keys is None:
        return
    model = context.bound_forest.models.subtrees.get(tree.name)
    declared = model.ports if model is not None else ()
    given = {*use.remapping.keys, *use.remapping.constants}
    unused = [
        name for name in use.element.attributes if name in given and name not in keys and name not in declared
    ]
    if not unused:
        return
    missing = sorted(key for key in keys if key not in given and not key.startswith("@"))
    hint = f"it uses {join_with_commas(missing)}" if missing else "delete it"
    for name in unused:
        message = f"{name}: the tree '{tree.name}' does not use this key"
        near = "_autoremap" if name == "autoremap" else intended_condition(name)
        near = near or context.guesses.nearest(name, missing)
        cause = None if near else Cause(f"the tree '{tree.name}' does not use these keys", name)
        advice = Advice(suggestion=near, hint=hint, common_cause=cause)
        yield use.element.finding("unused-argument", message, name=name, **advice)


def _undeclared_arguments(use: BoundNode, context: CheckContext) -> Iterator[Diagnostic]:
    """Yield findings about arguments that are missing from a tree's model, if only the model is known."""
    model = context.bound_forest.models.subtrees.get(use.spec.tag)
    if model is None or not model.ports:  # a model without ports may only declare that the tree exists
        return
    for name in [*use.remapping.keys, *use.remapping.constants]:
        if name not in model.ports:
            message = f"{name}: the model of the tree '{model.tag}' has no port of this name"
            near = context.guesses.nearest(name, model.ports)
            hint = f"it has {join_with_commas(model.ports)}"
            yield use.element.finding("unused-argument", message, name=name, suggestion=near, hint=hint)

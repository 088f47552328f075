"""Building the behaviours of a tree."""

import functools
from collections.abc import Iterator, Mapping
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.behaviours import Dummy
from py_trees.common import OneShotPolicy
from py_trees.composites import Sequence
from py_trees.decorators import OneShot, PassThrough

from sar_compiler.compiler.constructor_arguments import Arguments, write_constant
from sar_compiler.compiler.origins import Construction
from sar_compiler.nodes.binding.bound import Binding, BoundNode
from sar_compiler.nodes.binding.collector import Collector
from sar_compiler.nodes.binding.instances import Instance
from sar_compiler.nodes.binding.skips import SkipAnalysis
from sar_compiler.nodes.registry import is_own_word
from sar_compiler.nodes.spec import Kind
from sar_compiler.runtime.language_nodes import Conditions
from sar_compiler.tree.diagnostic import TreeError
from sar_compiler.tree.model import SUBTREE_TAG

_NodeInInstance = tuple[Instance, BoundNode]
"""A node of an instance."""


def report_without_class(bound: BoundNode, collector: Collector) -> None:
    """Report a node that cannot be made, because there is no class for it."""
    if bound.element.tag == SUBTREE_TAG:
        message = f"the tree '{bound.spec.tag}' is described by a model, but it is in no file"
        hint = "<include> the file that has it, or name that under [project] trees in sar.toml"
    else:
        what = "is described by a model" if bound.spec.is_only_described else "is a node of another program"
        message = f"<{bound.spec.tag}> {what}, but no class is registered for it"
        hint = "load the module that has it: --nodes package.module"
    if bound.spec.is_only_described and is_own_word(bound.spec.tag):
        hint += f", or delete the model if py_trees' <{bound.spec.tag}> is meant"
    collector.add("not-installed", message, bound.element, hint=hint)


class Builder:
    """Makes the behaviours of one tree.

    Attributes:
        constructions: How each behaviour was constructed.
    """

    def __init__(self, binding: Binding, arguments: Arguments, collector: Collector) -> None:
        self.constructions: list[Construction] = []
        self._source = arguments
        self._collector = collector
        self._skipping = SkipAnalysis(binding.trees())
        # Nodes that others refer to may be made before their place comes, so these are remembered.
        self._targets: set[BoundNode] = set()
        self._built: dict[tuple[Instance, BoundNode], Behaviour] = {}
        self._arguments: dict[tuple[Instance, BoundNode], dict[str, Any]] = {}

    def prepare(self, instance: Instance) -> None:
        """Name the entries of an instance and those in it, write their constants, and see that nodes can have all they need."""
        self._targets.update(target for _, target in instance.references.values())
        for bound in instance.tree.demanding:
            if bound.references:
                self._targets.update(bound.references.values())
            if bound.spec.is_foreign:
                self.report_only_described(bound)
            if bound.keys or bound.spec.handed_over:
                self._arguments[instance, bound] = self._source.of(instance, bound)
            if bound.subtree is not None:
                inner = instance.inner[bound]
                for key, value in inner.constants():
                    write_constant(inner.scope.resolve(key), value)
                self.prepare(inner)

    def report_only_described(self, bound: BoundNode) -> None:
        """Report a node for which there is no class."""
        report_without_class(bound, self._collector)

    def place(self, instance: Instance, bound: BoundNode) -> Behaviour:
        """Build a node in place, with its wrappers and all below it; not recursively, since trees may be deep."""
        left: Iterator[_NodeInInstance] = iter([(instance, bound)])
        children: list[Behaviour] = []
        # The nodes around, each with the siblings that are left and those that are made.
        waiting: list[tuple[_NodeInInstance, Iterator[_NodeInInstance], list[Behaviour]]] = []
        while True:
            for place in left:
                if place[1].children or place[1].subtree is not None:
                    waiting.append((place, left, children))
                    left, children = self._below(*place), []
                    break
                children.append(self._with_wrappers(*place, []))
            else:
                if not waiting:
                    return children[0]
                place, left, siblings = waiting.pop()
                siblings.append(self._with_wrappers(*place, children))
                children = siblings

    @staticmethod
    def _below(instance: Instance, bound: BoundNode) -> "Iterator[_NodeInInstance]":
        if bound.subtree is not None:
            inner = instance.inner[bound]
            assert inner.tree.root is not None  # noqa: S101 - otherwise there are findings
            yield inner, inner.tree.root
        elif bound.spec.structure:
            for child in bound.children:
                yield instance, child

    def _with_wrappers(self, instance: Instance, bound: BoundNode, children: list[Behaviour]) -> Behaviour:
        """Make a node, and the wrappers around it."""
        make = self._make_once if bound in self._targets else self._make
        behaviour = make(instance, bound, children)
        if bound.conditions:
            behaviour = self._conditions(instance, bound, behaviour)
        if bound.oneshot is not None:
            policy = OneShotPolicy[bound.oneshot]
            behaviour = OneShot(name=f"{bound.name}OneShot", child=behaviour, policy=policy)
            self.constructions.append(Construction(behaviour.id, instance, bound, {"policy": policy}))
        return behaviour

    def _conditions(self, instance: Instance, bound: BoundNode, child: Behaviour) -> Behaviour:
        name = f"{bound.name}Conditions"
        wrapper = Conditions(name, child, bound.conditions, instance.scope, self._source.enums)
        shown = {name: script.text for name, script in bound.conditions.items()}
        self.constructions.append(Construction(wrapper.id, instance, bound, shown))
        return wrapper

    def _make_once(
        self, instance: Instance, bound: BoundNode, children: list[Behaviour] | None = None
    ) -> Behaviour:
        if (instance, bound) not in self._built:
            if children is None:
                children = [self.place(*below) for below in self._below(instance, bound)]
            self._built[instance, bound] = self._make(instance, bound, children)
        return self._built[instance, bound]

    def _make(self, instance: Instance, bound: BoundNode, children: list[Behaviour]) -> Behaviour:
        spec = bound.spec
        known = self._arguments[instance, bound] if bound.keys or spec.handed_over else None
        arguments = self._source.of(instance, bound) if known is None else dict(known)
        for parameter in spec.references:
            target = instance.target_of(bound, parameter.name)
            if target is not None:
                arguments[parameter.name] = self._make_once(*target)
        if bound.subtree is not None:
            (arguments["child"],) = children
        elif spec.structure:
            arguments[spec.structure] = children if spec.kind is Kind.CONTROL else children[0]
        if spec.renamed:
            arguments = {spec.renamed.get(name, name): value for name, value in arguments.items()}
        try:
            behaviour: Behaviour = _require_initialised(self._maker(bound)(**arguments))
        except TreeError:
            raise
        except Exception as error:
            stand_in = self.stand_in(bound, arguments)
            if stand_in is None:
                raise _cannot_be_made(bound, error) from error
            behaviour = stand_in
        self.constructions.append(
            Construction(behaviour.id, instance, bound, None, known and self.known_values(bound, known))
        )
        return behaviour

    def stand_in(self, bound: BoundNode, arguments: Mapping[str, Any]) -> Behaviour | None:  # noqa: ARG002
        """Return what takes the place of a node whose constructor refuses its arguments; None for nothing."""
        return None

    def known_values(self, bound: BoundNode, arguments: Mapping[str, Any]) -> Mapping[str, Any] | None:
        """Return the values that plain attributes got from the blackboard."""
        if not bound.keys:
            return None
        return {parameter.name: arguments[parameter.name] for parameter in bound.spec.plain}

    def _maker(self, bound: BoundNode) -> Any:
        """Return what makes a node: a class of the project's where stock py_trees would misread a skip.

        A node that is only described becomes a stock behaviour of its kind (where there is no finding about it).
        """
        spec = bound.spec
        replacement = spec.skipping.replacement
        if replacement is not None and self._skipping.among_children(bound):
            return replacement.maker
        return spec.maker or functools.partial(_stand_in, spec.kind)


class PreviewBuilder(Builder):
    """Makes a tree to be looked at, whatever only a mission or a module of leaves has."""

    def report_only_described(self, bound: BoundNode) -> None:
        """Do nothing: a stock behaviour of its kind is used instead."""

    def stand_in(self, bound: BoundNode, arguments: Mapping[str, Any]) -> Behaviour | None:
        """Return a stock behaviour where a key's value, which is made up here, may be what was refused."""
        if not any(parameter.name in bound.keys for parameter in bound.spec.plain):
            return None
        return _stand_in(bound.spec.kind, **arguments)

    def known_values(self, bound: BoundNode, arguments: Mapping[str, Any]) -> None:  # noqa: ARG002
        """Return nothing: what is shown is the key."""
        return None  # noqa: RET501 - the base class returns a value


def _require_initialised(behaviour: Behaviour) -> Behaviour:
    if not hasattr(behaviour, "id"):
        raise TypeError("its constructor has not called super().__init__(name)")
    return behaviour


def _stand_in(kind: Kind, /, name: str, **structure: Any) -> Behaviour:
    if kind is Kind.CONTROL:
        return Sequence(name, memory=True, children=structure["children"])
    return PassThrough(name, structure["child"]) if kind is Kind.DECORATOR else Dummy(name)


def _cannot_be_made(bound: BoundNode, error: Exception) -> TreeError:
    element = bound.element
    message = f"<{bound.spec.tag}> cannot be made: {type(error).__name__}: {error}"
    return TreeError([element.finding("constructor-failed", message)])

"""Making the behaviours of a tree."""

import functools
from collections.abc import Callable, Mapping
from typing import Any
from uuid import UUID

from py_trees.behaviour import Behaviour
from py_trees.behaviours import Dummy
from py_trees.composites import Sequence
from py_trees.decorators import OneShot, PassThrough

from sar_compiler.compiler.arguments import Arguments
from sar_compiler.compiler.origins import Making
from sar_compiler.nodes.bound import Binding, BoundNode
from sar_compiler.nodes.collector import Collector
from sar_compiler.nodes.instances import Instance
from sar_compiler.nodes.skips import Skipping
from sar_compiler.nodes.spec import Kind
from sar_compiler.nodes.values import literal_value
from sar_compiler.runtime.conditions import Conditions, ConditionScripts
from sar_compiler.tree.diagnostic import Diagnostic, TreeError

_CONDITIONS = {
    "_failureIf": "failure_if",
    "_successIf": "success_if",
    "_skipIf": "skip_if",
    "_while": "while_",
    "_onSuccess": "on_success",
    "_onFailure": "on_failure",
    "_onHalted": "on_halted",
    "_post": "post",
}


class Builder:
    """Makes the behaviours of one tree.

    Args:
        binding: The tree.
        arguments: Knows what constructors are given.
        collector: Is told what keeps the tree from being made.

    Attributes:
        makings: How each behaviour was made, by its id.
    """

    def __init__(self, binding: Binding, arguments: Arguments, collector: Collector) -> None:
        self.makings: dict[UUID, Making] = {}
        self._source = arguments
        self._collector = collector
        self._skipping = Skipping(binding.nodes())
        # Nodes that others refer to may be made before their place comes, so these are remembered.
        self._targets: set[BoundNode] = set()
        self._built: dict[tuple[Instance, BoundNode], Behaviour] = {}
        self._arguments: dict[tuple[Instance, BoundNode], dict[str, Any]] = {}

    def prepare(self, instance: Instance) -> None:
        """Write the constants of the instances in one, and see that its nodes can have all they need."""
        for bound, inner in instance.inner.items():
            for key, text in bound.remapping.constants.items():
                inner.scope.resolve(key).write(literal_value(text))
        self._targets.update(target for _, target in instance.references.values())
        for bound in instance.tree.nodes:
            if bound.references:
                self._targets.update(bound.references.values())
            if bound.spec.cls is None:
                self.only_described(bound)
            if bound.keys or bound.spec.handed_over:
                self._arguments[instance, bound] = self._source.of(instance, bound)

    def only_described(self, bound: BoundNode) -> None:
        """Report a node for which there is no class."""
        message = f"<{bound.spec.tag}> is described by a model, but no class is registered for it"
        hint = "load the module that has it: --nodes package.module"
        self._collector.tag(bound.element, "not-installed", message, hint=hint)

    def place(self, instance: Instance, bound: BoundNode) -> Behaviour:
        """Make a node where it stands in the tree, with what is wrapped around it there."""
        behaviour = (
            self._remembered(instance, bound) if bound in self._targets else self._make(instance, bound)
        )
        if bound.conditions:
            behaviour = self._conditions(instance, bound, behaviour)
        if bound.oneshot is not None:
            policy = bound.oneshot
            behaviour = OneShot(name=f"{bound.name}OneShot", child=behaviour, policy=policy)
            self.makings[behaviour.id] = (instance, bound, {"policy": policy}, None)
        return behaviour

    def _conditions(self, instance: Instance, bound: BoundNode, child: Behaviour) -> Behaviour:
        scripts = ConditionScripts(**{_CONDITIONS[name]: script for name, script in bound.conditions.items()})
        name = f"{bound.name}Conditions"
        wrapper = Conditions(name, child, scripts, instance.scope, self._source.enums)
        shown = {name: script.text for name, script in bound.conditions.items()}
        self.makings[wrapper.id] = (instance, bound, shown, None)
        return wrapper

    def _remembered(self, instance: Instance, bound: BoundNode) -> Behaviour:
        if (instance, bound) not in self._built:
            self._built[instance, bound] = self._make(instance, bound)
        return self._built[instance, bound]

    def _make(self, instance: Instance, bound: BoundNode) -> Behaviour:
        """Make a node itself."""
        spec = bound.spec
        known = self._arguments.get((instance, bound)) if bound.keys or spec.handed_over else None
        arguments = dict(known) if known is not None else self._source.of(instance, bound)
        for parameter in spec.references:
            target = instance.referred(bound, parameter.name)
            if target is not None:
                arguments[parameter.name] = self._remembered(*target)
        if bound.subtree is not None:
            inner = instance.inner[bound]
            assert inner.tree.root is not None  # noqa: S101 - otherwise there are findings
            arguments["child"] = self.place(inner, inner.tree.root)
        elif spec.kind is Kind.CONTROL:
            arguments["children"] = [self.place(instance, child) for child in bound.children]
        elif spec.kind is Kind.DECORATOR:
            arguments["child"] = self.place(instance, bound.children[0])
        if spec.renamed:
            arguments = {spec.renamed.get(name, name): value for name, value in arguments.items()}
        try:
            behaviour: Behaviour = self.maker(bound)(**arguments)
        except TreeError:
            raise
        except Exception as error:
            raise _cannot_be_made(bound, error) from error
        # A plain tuple, as there is one for every node.
        self.makings[behaviour.id] = (instance, bound, None, self.known(bound, known))
        return behaviour

    def known(self, bound: BoundNode, arguments: Mapping[str, Any] | None) -> Mapping[str, Any] | None:
        """Return the values that plain attributes got from the blackboard."""
        if not bound.keys or arguments is None:
            return None
        return {parameter.name: arguments[parameter.name] for parameter in bound.spec.plain}

    def maker(self, bound: BoundNode) -> Callable[..., Any]:
        """Return what makes a node: a class of the project's where stock py_trees would misread a skip."""
        spec = bound.spec
        if spec.skip_cls is not None and self._skipping.among_children(bound):
            return spec.skip_cls
        maker = spec.factory or spec.cls
        assert maker is not None  # noqa: S101 - otherwise there is a finding
        return maker


class PreviewBuilder(Builder):
    """Makes a tree to be looked at: nodes that are only described become stock behaviours of their kind."""

    def only_described(self, bound: BoundNode) -> None:
        """Let it be."""

    def known(self, bound: BoundNode, arguments: Mapping[str, Any] | None) -> None:  # noqa: ARG002
        """Return nothing: what is shown is the key."""
        return None  # noqa: RET501 - the base class returns a value

    def maker(self, bound: BoundNode) -> Callable[..., Any]:
        """Return what makes a node, or a stock behaviour that stands for it."""
        if bound.spec.cls is not None:
            return super().maker(bound)
        return functools.partial(_stand_in, bound.spec.kind)


def _stand_in(kind: Kind, name: str, **structure: Any) -> Behaviour:
    if kind is Kind.CONTROL:
        return Sequence(name, memory=True, children=structure["children"])
    return PassThrough(name, structure["child"]) if kind is Kind.DECORATOR else Dummy(name)


def _cannot_be_made(bound: BoundNode, error: Exception) -> TreeError:
    element = bound.element
    message = f"<{bound.spec.tag}> cannot be made: {type(error).__name__}: {error}"
    return TreeError([Diagnostic("constructor-failed", message, element.source, element.tag_span())])

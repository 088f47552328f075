"""From a tree file and the registry to py_trees objects."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import py_trees
from py_trees.behaviour import Behaviour

from sar_compiler.compiler.building import Builder, PreviewBuilder, report_without_class
from sar_compiler.compiler.constructor_arguments import Arguments, PreviewArguments, write_constant
from sar_compiler.compiler.origins import Origin, Origins, remember
from sar_compiler.nodes.binding.binder import bind
from sar_compiler.nodes.binding.bound import Binding
from sar_compiler.nodes.binding.collector import Collector
from sar_compiler.nodes.binding.instances import Instance, expand
from sar_compiler.nodes.binding.tree_ids import find_main_tree
from sar_compiler.nodes.registry import Registry
from sar_compiler.nodes.spec import Use
from sar_compiler.runtime.blackboard import Board
from sar_compiler.tree.diagnostic import Diagnostic, Severity, TreeError
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.gc_pause import gc_paused
from sar_compiler.tree.model import TreeFile

__all__ = ["CompiledTree", "Origin", "bind_main", "compile_tree", "compile_with", "preview_tree"]


_OUTLINE = 25
"""The number of lines of a tree that are shown where it is only named."""


@dataclass(frozen=True, repr=False)
class CompiledTree:
    """A tree that can be ticked.

    Attributes:
        root: The py_trees behaviour at its root.
        origins: Where each behaviour comes from, by the behaviour's id.
        instance: The tree and its subtrees, with their keys.
    """

    root: Behaviour
    origins: Origins
    instance: Instance

    def __repr__(self) -> str:
        count = len(self.origins)
        lines = py_trees.display.ascii_tree(self.root).rstrip("\n").split("\n")
        shown = lines if len(lines) <= _OUTLINE else [*lines[: _OUTLINE - 1], "    ..."]
        head = f"<{type(self).__name__} of {count} {'node' if count == 1 else 'nodes'}>"
        return "\n".join([head, *(f"    {line}" for line in shown)])

    @property
    def board(self) -> Board:
        """Its entries on the blackboard."""
        return self.instance.scope.board

    def uses(self) -> list[Use]:
        """Return what its leaves need outside the tree, each once."""
        return list(dict.fromkeys(use for origin in self.origins.values() for use in origin.uses))


def bind_main(
    forest: Forest, registry: Registry, tree_id: str | None = None, palettes: Iterable[TreeFile] = ()
) -> Binding:
    """Bind the tree to execute.

    Raises:
        TreeError: If there is none, or an error in it; carries all the findings.
    """
    binding = bind(forest, registry, find_main_tree(forest, tree_id), palettes)
    findings = [*forest.findings, *forest.clashes, *binding.findings]
    if _has_error(findings):
        raise TreeError(findings)
    return binding


def compile_tree(
    binding: Binding, context: Mapping[type, object], parameters: Mapping[str, object]
) -> CompiledTree:
    """Compile a bound tree for a mission.

    Args:
        binding: The tree, without errors.
        context: The objects that the mission hands to its leaves, by their type.
        parameters: The keys of the root blackboard: the node parameters of the mission.

    Raises:
        TreeError: If a key is not there or its value does not fit, if the mission lacks an object that a
            leaf needs, or if a constructor refuses its arguments.
    """
    collector = Collector()
    return compile_with(
        binding, Builder(binding, Arguments(context, parameters, collector), collector), parameters, collector
    )


def require_classes(binding: Binding) -> None:
    """See that there is a class for every node of a bound tree.

    Raises:
        TreeError: If there is not; names each that has none.
    """
    collector = Collector()
    for bound in binding.nodes():
        if bound.spec.is_foreign:
            report_without_class(bound, collector)
    if collector.findings:
        raise TreeError(collector.findings)


def preview_tree(binding: Binding) -> CompiledTree:
    """Compile a bound tree for display, with stand-ins for what only a mission has.

    Blackboard keys that are not known get the parameter's default or some value of its type; a node that
    only a model describes becomes a stock behaviour of its kind.
    """
    collector = Collector()
    return compile_with(
        binding, PreviewBuilder(binding, PreviewArguments({}, {}, collector), collector), {}, collector
    )


def compile_with(
    binding: Binding, builder: Builder, parameters: Mapping[str, object], collector: Collector
) -> CompiledTree:
    """Compile a bound tree with a builder of one's own.

    Raises:
        TreeError: If the tree has errors, or the builder has findings.
    """
    if _has_error(binding.findings) or binding.main.root is None:
        raise TreeError(binding.findings)
    top = expand(binding.main, collector)
    for name, value in parameters.items():
        write_constant(top.scope.resolve(name), value)
    # Everything that can be said of the arguments is said at once, before anything is made.
    builder.prepare(top)
    if _has_error(collector.findings):
        raise TreeError(_in_order(collector.findings))
    with gc_paused():
        root, origins = builder.place(top, binding.main.root), Origins(builder.constructions)
    remember(root, origins)
    return CompiledTree(root, origins, top)


def _has_error(findings: Iterable[Diagnostic]) -> bool:
    return any(finding.severity is Severity.ERROR for finding in findings)


def _in_order(findings: list[Diagnostic]) -> list[Diagnostic]:
    """Sort findings by file, line and column, each once, however often its tree is used."""
    files = list(dict.fromkeys(finding.source.path for finding in findings))
    return sorted(
        dict.fromkeys(findings),
        key=lambda finding: (files.index(finding.source.path), finding.span.line, finding.span.column),
    )

"""Reading of `controls:`: stand-ins that a file beside a tree names for nodes whose behaviour is not known here."""

from collections.abc import Iterable, Sequence

from sar_compiler.compiler.stand_ins import described_parents, put_in_place, self_ticking_parents
from sar_compiler.documents.located import Document, Value
from sar_compiler.nodes.binding.bound import Binding, BoundNode
from sar_compiler.nodes.models import described_specs
from sar_compiler.nodes.registry import Registry
from sar_compiler.nodes.spec import NodeSpec
from sar_compiler.tree.guessing import nearest
from sar_compiler.tree.model import TreeFile


def take_controls(
    document: Document, controls: Value, binding: Binding, registry: Registry, files: Iterable[TreeFile]
) -> None:
    """Replace nodes that only a model or their own methods describe by a file's stand-ins; its mistakes become findings.

    Args:
        document: The file.
        controls: The value of its `controls:`.
        binding: The tree, which is changed.
        registry: The registered nodes.
        files: The tree files and palettes whose models describe nodes.
    """
    own = self_ticking_parents(binding)
    known = [spec.tag for spec in described_specs(files, registry) if not spec.kind.is_leaf]
    known += dict.fromkeys(node.spec.tag for node in own)
    stand_ins: dict[str, NodeSpec] = {}
    for key, value in controls.entries or ():
        tag = key.text or ""
        if tag not in known:
            listed = ", ".join(known) or "none"
            message = f"no control or decorator that only a model or its own methods describe is called '{tag}'; there is {listed}"
            document.report("unknown-node", message, key, suggestion=nearest(tag, known))
            continue
        nodes = [node for node in (*described_parents(binding), *own) if node.spec.tag == tag]
        spec = _stand_in(document, value, tag, nodes, registry)
        # Where there is a finding, anything may stand there while the others are sought.
        fits = (each for each in registry if not _misfit(each, nodes))
        stand_ins[tag] = spec or next(fits)
    put_in_place(binding, stand_ins)


def _stand_in(
    document: Document, value: Value, wanted: str, nodes: Sequence[BoundNode], registry: Registry
) -> NodeSpec | None:
    """Return the stand-in for some nodes; reports one that cannot be it."""
    tag = value.text or ""
    variants = registry.variants(tag)
    if not variants:
        parents = [spec.tag for spec in registry if not spec.kind.is_leaf]
        message = f"no control or decorator is called '{tag}'"
        hint = "sar-compile nodes lists them"
        document.report("unknown-node", message, value, suggestion=nearest(tag, parents), hint=hint)
        return None
    faults = [_misfit(spec, nodes) for spec in variants]
    if "" in faults:
        return variants[faults.index("")]
    message = f"<{tag}> cannot replace <{wanted}>: {faults[0]}"
    document.report("wrong-value", message, value, hint="sar-compile nodes TAG says what a node needs")
    return None


def _misfit(spec: NodeSpec, nodes: Sequence[BoundNode]) -> str:
    """Return why a node cannot replace some others; empty if it can."""
    if spec.kind.is_leaf:
        return "it is a leaf"
    needed = [each.name for each in (*spec.required, *spec.references) if each.required]
    if needed:
        return f"it needs {', '.join(dict.fromkeys(needed))}, and would have nothing but defaults here"
    least, most = spec.child_count
    for node in nodes:
        count = len(node.children)
        if count < least or (most is not None and count > most):
            children = "one child" if count == 1 else f"{count} children"
            return f"'{node.name}' in line {node.element.line} has {children}"
    return ""

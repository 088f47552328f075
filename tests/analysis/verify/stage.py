"""Helpers that verify small trees of the leaves of `leaves.py`."""

from sar_compiler.analysis.assumptions import read_assumptions
from sar_compiler.analysis.simulated_tree import compile_simulated
from sar_compiler.analysis.verify import verify
from sar_compiler.analysis.verify.properties import parse_property_file
from sar_compiler.analysis.verify.verdicts import ProofStatus
from sar_compiler.compiler import bind_main
from sar_compiler.nodes.registry import load_registry
from tests.trees import forest

REGISTRY = load_registry(["tests.analysis.verify.leaves"])
TAGS = {spec.tag for spec in REGISTRY if spec.kind.is_leaf}


def bound(body):
    """Bind a tree."""
    return bind_main(forest(body), REGISTRY)


def simulated_tree(binding, file=None):
    """Compile a bound tree for simulation, with the assumptions of a properties file."""
    if file is None:
        return compile_simulated(binding, {})
    with file.document.prefer_findings():
        plain = compile_simulated(binding, file.parameters)
        assumptions = read_assumptions(file.document, file.facts, file.outcomes, plain)
        return compile_simulated(binding, file.parameters, assumptions)


def verified(body, properties=None, max_states=20_000):
    """Verify a tree with the text of a properties file."""
    file = None if properties is None else parse_property_file(properties, "props.yaml")
    return verify(simulated_tree(bound(body), file), file, TAGS, max_states)


def verdict(verification, question):
    return next(each for each in verification.verdicts if each.question == question)


def outcome(verification, question):
    return verdict(verification, question).outcome


def told(trace):
    """Return the outcomes and halts of leaves in a trace, as one string a tick."""
    return [
        " ".join(
            f"{event.leaf}:{event.action}" for event in tick.events if event.what in ("returned", "halted")
        )
        for tick in trace.ticks
    ]


PROVED, BROKEN, UNDECIDED = ProofStatus.PROVED, ProofStatus.BROKEN, ProofStatus.UNDECIDED

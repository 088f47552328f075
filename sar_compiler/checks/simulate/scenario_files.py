"""Reading scenarios; every mistake in one is a finding with its place."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from sar_compiler.checks.assumptions import (
    StartValues,
    check_answers,
    raise_disputes,
    read_assumptions,
    start_assumptions,
    take_controls,
)
from sar_compiler.checks.leaf_words import LeafWords
from sar_compiler.checks.simulate.expecting import read_expectations
from sar_compiler.checks.simulate.run_variables import OWN
from sar_compiler.checks.simulate.scenario import MAX_TICKS, PERIOD_SEC, Scenario
from sar_compiler.checks.simulate.steps import read_scripts
from sar_compiler.checks.typed_values import parameters, seconds, word
from sar_compiler.compiler import bind_main
from sar_compiler.compiler.simulated_tree import Assumptions, SimulatedTree, compile_simulated
from sar_compiler.documents.located import Document, Value
from sar_compiler.documents.yaml_files import read_yaml
from sar_compiler.nodes.binding.bound import Binding
from sar_compiler.nodes.registry import Registry
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.model import TreeFile

_EMPTY_HINT = "write leaves: with what they answer, and expect: with what must come of it"


class Stage:
    """A tree file on which scenarios are played.

    Args:
        forest: The file and what it includes.
        registry: What tags mean.
        palettes: Further files whose `TreeNodesModel` describes nodes that are not installed.
        tree_id: The tree that is played where a scenario names none; by default the one that the file executes.
        start: Returns what the parameters of a mission say of the runs of a tree.
    """

    def __init__(
        self,
        forest: Forest,
        registry: Registry,
        palettes: tuple[TreeFile, ...] = (),
        tree_id: str | None = None,
        start: Callable[[Binding], StartValues] = lambda _binding: StartValues(),
    ) -> None:
        self.forest = forest
        self._registry = registry
        self._palettes = palettes
        self._tree_id = tree_id
        self.start = start
        self._bindings: dict[str | None, Binding] = {}

    def with_controls(self, document: Document, controls: Value, tree_id: str | None) -> Binding:
        """Return a tree of the file with what a scenario says of its controls and decorators; raises as `binding`."""
        binding = bind_main(self.forest, self._registry, tree_id or self._tree_id, self._palettes)
        files = (*self._palettes, *self.forest.files)
        take_controls(document, controls, binding, self._registry, files)
        return binding

    def binding(self, tree_id: str | None = None) -> Binding:
        """Return a tree of the file, bound.

        Raises:
            TreeError: If there is none, or anything in it is wrong.
        """
        wanted = tree_id or self._tree_id
        if wanted not in self._bindings:
            self._bindings[wanted] = bind_main(self.forest, self._registry, wanted, self._palettes)
        return self._bindings[wanted]

    def play(self) -> "Play":
        """Return the tree without a scenario: every leaf answers what is usual.

        Raises:
            TreeError: If the tree cannot be used.
            DisputedFactError: If its leaves start a fact with different values.
        """
        binding = self.binding()
        start = self.start(binding)
        simulated = _simulated(binding, start.parameters, lambda plain: start_assumptions(start, plain))
        raise_disputes(simulated)
        return Play(simulated, Scenario(period_sec=start.period_sec or PERIOD_SEC))


@dataclass(frozen=True)
class Play:
    """A tree, simulated for a scenario.

    Attributes:
        simulated: The tree.
        scenario: The scenario.
    """

    simulated: SimulatedTree
    scenario: Scenario


def read_scenario(path: str | Path, stage: Stage) -> Play:
    """Read a scenario.

    Raises:
        UnreadableFileError: If the file is not there or cannot be read.
        TreeError: If anything is wrong with it, or with the tree; carries all the findings.
    """
    return understand(read_yaml(path, _EMPTY_HINT), stage)


def understand(document: Document, stage: Stage) -> Play:
    """Return the tree and the scenario that a file describes.

    Raises:
        TreeError: If anything is wrong with it, or with the tree; carries all the findings.
    """
    parts = document.validate("scenario").mapping
    with document.findings_first():
        binding = _binding(document, parts.get("tree"), parts.get("controls"), stage)
        start = stage.start(binding)
        facts, answers = parts.get("facts"), parts.get("answers")
        simulated = _simulated(
            binding,
            {**start.parameters, **parameters(parts.get("parameters"))},
            lambda plain: start_assumptions(start, plain) | read_assumptions(document, facts, answers, plain),
        )
        for message in simulated.disputes.values():
            document.report("missing-value", message, facts or document.root)
    words = LeafWords(simulated)
    check_answers(document, answers, words)
    path = document.source.path
    scenario = Scenario(
        name=(parts["name"].text if "name" in parts else None) or Path(path).stem,
        path=path,
        period_sec=seconds(parts["period"]) if "period" in parts else start.period_sec or PERIOD_SEC,
        max_ticks=int(parts["ticks"].data) if "ticks" in parts else MAX_TICKS,
        until=words.condition(document, parts.get("until"), OWN),
        scripts=read_scripts(document, parts["leaves"], words) if "leaves" in parts else {},
        expect=read_expectations(document, parts.get("expect"), simulated, words),
    )
    document.raise_findings()
    return Play(simulated, scenario)


def _binding(document: Document, tree: Value | None, controls: Value | None, stage: Stage) -> Binding:
    tree_id = None if tree is None else word(document, tree, stage.forest.trees, "the tree")
    return stage.binding(tree_id) if controls is None else stage.with_controls(document, controls, tree_id)


def _simulated(
    binding: Binding,
    parameters: Mapping[str, object],
    assumptions_for: Callable[[SimulatedTree], Assumptions],
) -> SimulatedTree:
    """Compile the tree for simulation, with all that is assumed of it."""
    # What may be assumed depends on the leaves, so the tree is looked at first.
    plain = compile_simulated(binding, parameters)
    assumed = assumptions_for(plain)
    return plain if assumed == Assumptions() else compile_simulated(binding, parameters, assumed)

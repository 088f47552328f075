"""From a tree file to all that is decided, known and found out about it.

What a project's configuration decides is added to what the user says: a `Workspace` has the latter, makes a `Project`
for each configuration that it meets, and loads trees. Every command and every test of a tree goes this way.
"""

import functools
import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from sar_compiler.checks import check, check_palettes
from sar_compiler.checks.configuration import Configuration, configuration_for, repository_of
from sar_compiler.compiler import CompiledTree, bind_main, compile_tree, preview_tree
from sar_compiler.nodes.binding.bound import Binding
from sar_compiler.nodes.installed import ignored_entry_points, is_installed
from sar_compiler.nodes.registry import ENTRY_POINTS, Named, Registry, load_registry
from sar_compiler.project.trust import Content
from sar_compiler.runtime.clock import Clock
from sar_compiler.tree.diagnostic import Diagnostic, Severity, TreeError
from sar_compiler.tree.forest import Forest, Read, load_forest
from sar_compiler.tree.model import TreeFile
from sar_compiler.tree.reading import read_tree_file
from sar_compiler.tree.shipped import find_tree
from sar_compiler.tree.source import Source

if TYPE_CHECKING:
    from rclpy.node import Node

    from sar_compiler.checks.simulate.scenario_files import Stage
    from sar_compiler.checks.verify import Progress, Verification
    from sar_compiler.documents.located import Document
    from sar_compiler.project.simulated import Simulated


@dataclass(frozen=True)
class Additions:
    """What the user adds to any project's configuration, and may reach anywhere with.

    Attributes:
        nodes: Leaves: import paths of modules, which may lie in the current folder; modules; classes.
        models: Palettes, which describe nodes that are not installed.
        include_path: Further folders that may be included from.
        trust: Whether to run, now and until they change, the modules that configurations bring along.
        registry: What tags mean; None for what is installed, and named.
    """

    nodes: tuple[Named, ...] = ()
    models: tuple[Path, ...] = ()
    include_path: tuple[Path, ...] = ()
    trust: bool = False
    registry: Registry | None = None


@dataclass
class Project:
    """What the tree files of one configuration have in common.

    Attributes:
        configuration: What is decided for them.
        checkout: The folder that brings no code: the repository, or what lies beside the configuration.
        additions: What the user adds.
    """

    configuration: Configuration
    checkout: Path
    additions: Additions

    @functools.cached_property
    def registry(self) -> Registry:
        """What tags mean.

        Raises:
            TreeError: If the configuration names modules that are neither installed nor trusted.
            RegistryError: If a module cannot be imported or has no leaves.
            TrustError: If trust cannot be recorded.
        """
        if self.additions.registry is not None:
            return self.additions.registry
        wanted = [each for each in self.configuration.nodes if each not in self.additions.nodes]
        brought = [each for each in wanted if not is_installed(each, self.checkout)]
        if brought:
            self._require_trust(brought)
        return load_registry(self.additions.nodes, wanted, self.checkout)

    def _require_trust(self, modules: list[str]) -> None:
        """Let modules be imported that lie beside the configuration, if the user trusts them."""
        path = self.configuration.path
        assert path is not None  # noqa: S101 - it has named the modules
        content = Content.of(path, modules)
        if self.additions.trust:
            content.trust()
        elif not content.is_trusted:
            raise TreeError([self._untrusted(each) for each in modules])
        content.make_importable()

    def _untrusted(self, module: str) -> Diagnostic:
        message = f"'{module}' is not installed, and a configuration brings no code along"
        hint = f"install it, name it yourself (--nodes {module}), or trust what lies here, until it changes: --trust"
        source, span = self.configuration.source, self.configuration.node_spans[module]
        return Diagnostic("untrusted-nodes", message, source, span, hint=hint)

    @functools.cached_property
    def palettes(self) -> tuple[TreeFile, ...]:
        """What describes nodes that are not installed.

        Raises:
            UnreadableFileError: If a file is not there or cannot be read.
            TreeError: If one is malformed.
        """
        return tuple(read_tree_file(path) for path in (*self.additions.models, *self.configuration.models))

    @functools.cached_property
    def findings(self) -> list[Diagnostic]:
        """What is wrong with the palettes, whatever tree they are for."""
        return self.configuration.decide(check_palettes(self.palettes, self.registry))

    @property
    def include_path(self) -> tuple[Path, ...]:
        """The further folders that may be included from."""
        return (*self.additions.include_path, *self.configuration.include_path)


@dataclass
class Workspace:
    """Loads tree files, each with what its project decides.

    Attributes:
        additions: What the user adds.
        read: Reads one tree file; an editor has the text of those that are open.
        note: Is told what is passed over for safety's sake, each once.
    """

    additions: Additions = field(default_factory=Additions)
    read: Read = read_tree_file
    note: Callable[[str], None] = lambda _text: None
    _projects: dict[tuple[Path | None, Path], Project] = field(default_factory=dict)
    _noted: set[str] = field(default_factory=set)

    def load(self, tree: str | Path) -> "LoadedTree":
        """Load a tree.

        Args:
            tree: The path of a tree file, or the name of a shipped tree.

        Raises:
            UnreadableFileError: If the file is not there or cannot be read.
            TreeError: If the project's configuration has mistakes.
        """
        path = find_tree(str(tree))
        return LoadedTree(path, self.project_of(path), self.read)

    def project_of(self, path: Path) -> Project:
        """Return the project of a tree file.

        Raises:
            UnreadableFileError: If its configuration cannot be read.
            TreeError: If that has mistakes.
        """

        def pass_over(foreign: Path) -> None:
            self._note(f"{foreign} is passed over: it belongs neither to you nor to the owner of {path}")

        configuration = configuration_for(path, pass_over)
        folder = (configuration.path or path.resolve()).parent
        checkout = repository_of(folder) or folder
        key = (configuration.path, checkout)
        if key not in self._projects:
            self._projects[key] = Project(configuration, checkout, self.additions)
            for entry_point, place in ignored_entry_points(ENTRY_POINTS, checkout):
                self._note(
                    f"the leaves of '{entry_point.value}' are passed over: {place} says that they are installed, "
                    f"but is part of what is looked at; install them, or say --nodes {entry_point.value}"
                )
        return self._projects[key]

    def _note(self, text: str) -> None:
        if text not in self._noted:
            self._noted.add(text)
            self.note(text)


class LoadedTree:
    """A tree file with everything that it includes, and all that its project decides.

    Args:
        path: The file.
        project: What is decided for it.
        read: Reads one tree file.

    Raises:
        UnreadableFileError: If the file is not there or cannot be read.
    """

    def __init__(self, path: Path, project: Project, read: Read = read_tree_file) -> None:
        self.path = path
        self.project = project
        self._forest: Forest | None = None
        self._malformed: tuple[Diagnostic, ...] = ()
        try:
            self._forest = load_forest(path, read, project.include_path)
        except TreeError as error:
            self._malformed = error.findings

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.path}>"

    @property
    def forest(self) -> Forest:
        """The file and what it includes.

        Raises:
            TreeError: If the file is malformed.
        """
        if self._forest is None:
            raise TreeError(self._malformed)
        return self._forest

    @property
    def tree_file(self) -> TreeFile | None:
        """What the file itself says; None if it is malformed."""
        return self._forest.main if self._forest is not None else None

    @property
    def source(self) -> Source:
        """The text of the file."""
        return self._forest.main.source if self._forest is not None else self._malformed[0].source

    @functools.cached_property
    def findings(self) -> list[Diagnostic]:
        """What is wrong with the file and those that it includes, as bad as the project says."""
        if self._forest is None:
            return list(self._malformed)
        project = self.project
        return project.configuration.decide(check(self._forest, project.registry, project.palettes))

    def check(self) -> list[Diagnostic]:
        """Return everything that is wrong: with the palettes, the file, and the files that it includes.

        Raises:
            TreeError: If a palette is malformed, or the configuration names modules that are not trusted.
            UnreadableFileError: If a palette cannot be read.
        """
        return [*self.project.findings, *self.findings]

    def binding(self, tree_id: str | None = None) -> Binding:
        """Return a tree of the file, bound.

        Args:
            tree_id: The tree; by default the one that the file executes.

        Raises:
            TreeError: If there is none, or there are errors; carries them.
        """
        self._require_no_errors(tree_named=tree_id is not None)
        return bind_main(self.forest, self.project.registry, tree_id, self.project.palettes)

    def _require_no_errors(self, *, tree_named: bool) -> None:
        errors = [each for each in self.check() if each.severity is Severity.ERROR]
        if tree_named:
            # Which tree is the main one does not matter where one is asked for.
            errors = [each for each in errors if each.code != "no-main-tree"]
        if errors:
            raise TreeError(errors)

    def stage(self, tree_id: str | None = None) -> "Stage":
        """Return what scenarios are played on.

        Args:
            tree_id: The tree that is played where a scenario names none; by default the one that the file executes.

        Raises:
            TreeError: If there are errors.
        """
        from sar_compiler.checks.simulate.scenario_files import Stage

        self._require_no_errors(tree_named=True)
        return Stage(self.forest, self.project.registry, self.project.palettes, tree_id)

    def compile(
        self,
        *,
        node: "Node | None" = None,
        parameters: Mapping[str, object] | None = None,
        context: Mapping[type, object] | None = None,
        tree_id: str | None = None,
    ) -> CompiledTree:
        """Compile a tree, to be ticked.

        Args:
            node: The node that it will be ticked on: its clock is the tree's, its parameters are keys of the root
                blackboard. Without one, the clock is the machine's steady one.
            parameters: Further keys of the root blackboard; they count before the node's parameters.
            context: Objects that leaves ask for in their constructors, by their type.
            tree_id: The tree in the file; by default the one that the file executes.

        Raises:
            TreeError: If there are errors, a key has no value or one that does not fit, a leaf needs an object that
                *context* does not have, or a constructor refuses its arguments.
        """
        binding = self.binding(tree_id)
        of_node: dict[str, object] = {}
        clock: dict[type, object] = {}
        if node is not None:
            from sar_compiler.ros.clock import RosClock
            from sar_compiler.ros.parameters import flat_parameters

            of_node, clock = flat_parameters(node), {Clock: RosClock(node)}
        return compile_tree(binding, {**clock, **(context or {})}, {**of_node, **(parameters or {})})

    def preview(self, tree_id: str | None = None) -> CompiledTree:
        """Compile a tree with stand-ins for what only a mission has, to be looked at.

        Raises:
            TreeError: If there are errors.
        """
        return preview_tree(self.binding(tree_id))

    def simulate(
        self,
        *,
        leaves: Mapping[str, object] | None = None,
        scenario: Mapping[str, object] | None = None,
        **scripts: object,
    ) -> "Simulated":
        """Return the tree with leaves that answer by a script, to be ticked on a clock that is moved by hand.

        What is written is what a scenario's file has, with lists and dictionaries for YAML's.

        Args:
            leaves: What leaves answer, by path, name or tag: `{"Patrol/NavigateToZone": ["aborted", "arrived"]}`.
            scenario: What else a scenario says: `{"tree": "Main", "facts": {"zones_left": 1}, "period": "0.1s"}`.
            **scripts: What leaves answer, for names that are Python's: `NavigateToZone=["aborted", "arrived"]`.

        Raises:
            TreeError: If there are errors, or the script says something of a leaf that it never does.
        """
        from sar_compiler.project.simulated import simulated

        return simulated(self, {**(scenario or {}), "leaves": {**(leaves or {}), **scripts}})

    def verify(
        self,
        properties: str | Path | None = None,
        *,
        facts: "Mapping[str, object] | Document | None" = None,
        tree_id: str | None = None,
        max_states: int = 1_000_000,
        report: "Callable[[Progress], None]" = lambda _progress: None,
    ) -> "Verification":
        """Go through all possible runs of the tree, and find out what holds in every one.

        Args:
            properties: A file that says what must hold; by default the mission's own for a mission with zones.
            facts: What facts are at the start, besides what the file says: `{"zones_left": 4}`.
            tree_id: The tree in the file; by default the one that the file executes.
            max_states: How many states to go through at most.
            report: Is told now and then how far it is.

        Raises:
            TreeError: If there are errors, or the file of properties says something that makes no sense for the tree.
            UndecidableError: If the runs of the tree cannot be gone through.
        """
        from sar_compiler.project.proof import verified

        return verified(self, self.binding(tree_id), properties, facts, max_states, report)


def load(
    tree: str | Path,
    *,
    nodes: Iterable[Named] = (),
    models: Iterable[str | Path] = (),
    include_path: Iterable[str | Path] = (),
    registry: Registry | None = None,
) -> LoadedTree:
    """Load a tree file, with what its project's configuration decides.

    Args:
        tree: The path of a tree file, or the name of a shipped tree (`search_and_rescue`).
        nodes: Leaves of your own: classes, modules, or import paths of modules.
        models: Palettes, which describe nodes that are not installed.
        include_path: Further folders that the file may include from.
        registry: What tags mean, in place of what is installed and *nodes*.

    Raises:
        UnreadableFileError: If the file is not there or cannot be read.
        TreeError: If the project's configuration has mistakes. What is wrong with the tree, `check` returns, and
            `compile`, `simulate` and `verify` raise.
    """
    palettes, folders = (tuple(Path(path) for path in each) for each in (models, include_path))
    additions = Additions(tuple(nodes), palettes, folders, registry=registry)
    # The frames between are `_note`, `project_of` and the two `load`.
    return Workspace(additions, note=lambda text: warnings.warn(text, stacklevel=6)).load(tree)

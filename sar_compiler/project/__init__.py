"""Loading of tree files with their project's configuration, to check, compile, simulate and verify them.

The settings of a project's configuration are combined with the user's: a `Workspace` has the latter, makes a `Project`
for each configuration that it finds, and loads trees. All commands and all tests of a tree use it.
"""

import contextlib
import functools
import os
import shlex
import warnings
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from sar_compiler.checks import check_beginning, check_context, check_palettes, context_of, first_of_each
from sar_compiler.checks.rules import CheckContext
from sar_compiler.missions import ENTRY_POINTS as MISSIONS
from sar_compiler.nodes.binding.attributes import CONDITIONS
from sar_compiler.nodes.binding.bound import Binding
from sar_compiler.nodes.installed import entry_points, ignored_entry_points, is_offered
from sar_compiler.nodes.models import described_specs, enums_file, supplements, undescribed_tags
from sar_compiler.nodes.palettes import PaletteError, is_palette_name, load_palettes
from sar_compiler.nodes.registry import ENTRY_POINTS, Named, Registry, is_own_word, load_registry
from sar_compiler.opener import TREE, NamedPath, UnreadableFileError, admit, is_there, read_file
from sar_compiler.project.surroundings import FilesAround, FileSurroundings, find_surroundings
from sar_compiler.runtime.answers import Fact
from sar_compiler.runtime.expressions import Script
from sar_compiler.tree.content import as_written, real_path
from sar_compiler.tree.diagnostic import Diagnostic, Severity, Source, TreeError
from sar_compiler.tree.forest import Forest, Read, TreeSet, load_forest
from sar_compiler.tree.gathering import files_meant, find_tree, read_tree_file
from sar_compiler.tree.model import Element, FileBeginning, TreeFile

if TYPE_CHECKING:
    from rclpy.node import Node

    from sar_compiler.budget import Budget
    from sar_compiler.checks.assumptions import StartValues
    from sar_compiler.checks.conformance import Conformance
    from sar_compiler.checks.predict import Prediction
    from sar_compiler.checks.property_watch import PropertyWatch
    from sar_compiler.checks.simulate.scenario_files import Stage
    from sar_compiler.checks.trying import TrialBudget
    from sar_compiler.checks.verify.properties import PropertyFile
    from sar_compiler.checks.verify.verdicts import Verification
    from sar_compiler.compiler import CompiledTree
    from sar_compiler.compiler.simulated_tree import SimulatedTree
    from sar_compiler.documents.located import Document
    from sar_compiler.missions.beginning import Beginning
    from sar_compiler.missions.mission import Mission
    from sar_compiler.project.simulated import Simulated
    from sar_compiler.ros.parameter_reader import ParameterReader
    from sar_compiler.runtime.events import Event
    from sar_compiler.views.sketch import Drawable


class Additions(NamedTuple):
    """The user's additions to any project's configuration, which may refer to any file.

    Attributes:
        nodes: Leaves: import paths of modules, which may be in the current folder; modules; classes.
        models: Palettes, which describe nodes that are not installed: files, or names of installed ones (`nav2:jazzy`).
        include_path: Further folders that may be included from.
        trust: Whether to run, now and until they change, the modules beside configurations.
        registry: The registered nodes; None for the installed and named ones.
        trees: Further tree files, in which a tree is sought that a file lacks.
        mission: The name of the mission, whatever the leaves of a tree require; None to choose it by them.
        folders: Folders that the user has named; the files in them belong together, as those of a repository do.
        names: Tree files as the user has named them, for findings in them.
        is_isolated: Whether the surroundings of a file are ignored: configuration, palettes and trees around it.
    """

    nodes: tuple[Named, ...] = ()
    models: tuple[Path, ...] = ()
    include_path: tuple[Path, ...] = ()
    trust: bool = False
    registry: Registry | None = None
    trees: tuple[Path, ...] = ()
    mission: str | None = None
    folders: tuple[Path, ...] = ()
    names: tuple[Path, ...] = ()
    is_isolated: bool = False

    @property
    def palettes(self) -> tuple[str, ...]:
        """The palettes that are installed."""
        return tuple(str(each) for each in self.models if is_palette_name(str(each)))


class Project:
    """The common settings of the tree files of one configuration.

    Attributes:
        configuration: Their configuration.
        checkout: The folder whose code is not trusted: the repository, or the configuration's folder.
        files_around: The palettes and tree files around them that nobody has named.
        used_palettes: Those of these palettes that were used, by their paths.
        used_trees: Those of these tree files that were used, by their paths.
        additions: The user's additions.
        tree_set: The files in which a tree is sought that a file lacks; None if there are none.
    """

    def __init__(
        self,
        surroundings: FileSurroundings,
        additions: Additions,
        read: Read,
    ) -> None:
        self.configuration, self.checkout, self.files_around = surroundings
        self.additions = additions
        self.used_palettes: dict[Path, None] = {}
        self.used_trees: dict[Path, None] = {}
        self._names = {real_path(each): each for each in additions.names}
        self.tree_set: TreeSet | None = None
        self._read = read
        self.renew_set()

    def renew_set(self) -> None:
        """Have the files of the set read anew, by who asks for a tree next."""
        if self.configuration.trees or self.additions.trees or self.files_around.folder is not None:
            is_declared = bool(self.configuration.trees)
            self.tree_set = TreeSet(self._set_files, self._read, self.include_path, is_declared=is_declared)

    @functools.cached_property
    def registry(self) -> Registry:
        """The registered nodes.

        Raises:
            TreeError: If the configuration names modules that are neither installed nor trusted, or a palette that is not
                installed.
            RegistryError: If a module cannot be imported or has no leaves.
            TrustError: If trust cannot be recorded.
            PaletteError: If the user has named a palette that is not installed.
        """
        if self.additions.registry is not None:
            return self.additions.registry
        wanted = [each for each in self.configuration.nodes if each not in self.additions.nodes]
        brought = [each for each in wanted if not is_offered(each, ENTRY_POINTS, self.checkout)]
        if brought:
            self._require_trust(brought)
        palettes = (*self.additions.palettes, *self.configuration.palettes)
        try:
            return load_registry(self.additions.nodes, wanted, self.checkout, palettes)
        except PaletteError:
            for name in self.configuration.palettes:
                with self._tell_where_it_is_named(name):
                    load_palettes([name], self.checkout)
            raise

    def _require_trust(self, modules: list[str]) -> None:
        """Allow the import of modules beside the configuration, if the user trusts them."""
        from sar_compiler.project.trust import Content

        path = self.configuration.path
        assert path is not None  # noqa: S101 - it has named the modules
        content = Content.of(path, modules)
        if self.additions.trust:
            content.trust()
        elif not content.is_trusted:
            raise TreeError([self._trust_finding(each, modules) for each in modules])
        content.make_importable()

    def _trust_finding(self, module: str, modules: Sequence[str]) -> Diagnostic:
        message = (
            f"'{module}' is not of an installed package that registers leaves ('{ENTRY_POINTS}'), and a configuration "
            "brings no code along"
        )
        options = " ".join(f"--nodes {each}" for each in modules)
        hint = (
            f"add {options} to the command, as in CI, or run pip install in a step before it; "
            "--trust runs what lies here until it changes"
        )
        source, span = self.configuration.source, self.configuration.spans[module]
        return Diagnostic("untrusted-nodes", message, source, span, hint=hint)

    @functools.cached_property
    def palettes(self) -> tuple[TreeFile, ...]:
        """The palettes that are files, which describe nodes that are not installed.

        Raises:
            UnreadableFileError: If a file that the user has named does not exist or cannot be read.
            TreeError: If one is malformed, or cannot be read that the configuration names.
        """
        files = [path for path in self.additions.models if not is_palette_name(str(path))]
        read = [read_tree_file(path) for path in files]
        for path in self.configuration.models:
            with self._tell_where_it_is_named(str(path)):
                read.append(read_tree_file(path))
        if self.configuration.enums:
            read.append(enums_file(self.configuration.enums))
        return tuple(read)

    @contextlib.contextmanager
    def _tell_where_it_is_named(self, palette: str) -> Iterator[None]:
        """Raise a finding in the configuration instead of an error about a palette that it names."""
        try:
            yield
        except (UnreadableFileError, PaletteError) as error:
            source, span = self.configuration.source, self.configuration.spans[palette]
            raise TreeError([Diagnostic("setting-not-found", str(error), source, span)]) from error

    @functools.cached_property
    def _palettes_around(self) -> tuple[TreeFile, ...]:
        """The palettes that nobody has named; one that is malformed is reported as a file."""
        found = []
        for path in self.files_around.palettes:
            with contextlib.suppress(TreeError, UnreadableFileError):
                found.append(read_tree_file(path))
        return tuple(found)

    def palettes_for(self, forest: Forest) -> tuple[TreeFile, ...]:
        """Return the palettes for a file: those that are named, and for nodes that nothing else describes the nearest ones around it.

        Raises:
            TreeError, UnreadableFileError: As `palettes`.
        """
        own = [_real_path(each) for each in forest.files]
        named = tuple(each for each in self.palettes if _real_path(each) not in own)
        tags = undescribed_tags([*forest.files, *forest.others], named)
        wanted = {tag for tag in tags if tag not in self.registry or is_own_word(tag)}
        if not wanted:
            return named

        around = [each for each in self._palettes_around if _real_path(each) not in own]
        nearest = sorted(around, key=lambda each: -len(os.path.commonpath([_real_path(each).parent, own[0]])))
        found = list(supplements(nearest, wanted))
        self.used_palettes |= dict.fromkeys(Path(each.source.path) for each in found)
        return (*named, *found)

    @functools.cached_property
    def findings(self) -> list[Diagnostic]:
        """The findings about the palettes, for any tree."""
        return self.configuration.decide(check_palettes(self.palettes, self.registry))

    @functools.cached_property
    def vocabulary(self) -> Registry:
        """All nodes that a tree can be written with: the registered ones, and those that palettes describe.

        Raises:
            TreeError: If a palette has mistakes, or the configuration names modules that are not trusted.
            UnreadableFileError: If a palette cannot be read.
        """
        if any(each.severity is Severity.ERROR for each in self.findings):
            raise TreeError(self.findings)
        described = described_specs([*self.palettes, *self._palettes_around], self.registry)
        return Registry([*self.registry.specs(), *described]) if described else self.registry

    def _set_files(self) -> Iterator[Path]:
        """Yield the tree files that belong together.

        Raises:
            UnreadableFileError: If a file or a folder that the configuration names does not exist or cannot be read.
        """
        yield from self.additions.trees
        if not self.configuration.trees:
            yield from (self._names.get(real_path(each), each) for each in self.files_around.trees)
        for folder, pattern in self.configuration.trees:
            for path in map(as_written, files_meant(folder, pattern)):
                if not is_there(path):
                    read_file(path, TREE)  # says why
                place = real_path(path)
                if place.is_relative_to(self.checkout):
                    yield self._names.get(place) or NamedPath.within(path, (self.checkout,))

    def note_use(self, forest: Forest) -> None:
        """Note which files around were used for trees that a file lacks."""
        if self.configuration.trees:
            return
        given = {*map(real_path, self.additions.trees), *self._names}
        used = {Path(home.main.source.path): home.place for home in forest.homes.values()}
        self.used_trees |= dict.fromkeys(path for path, place in used.items() if place not in given)

    @property
    def include_path(self) -> tuple[Path, ...]:
        """The further folders that may be included from."""
        root = self.files_around.root
        return (*self.additions.include_path, *self.configuration.include_path, *([root] if root else []))


_MOST_NAMED = 5
"""The number of files that a note names."""


def _real_path(tree_file: TreeFile) -> Path:
    return real_path(Path(tree_file.source.path))


@dataclass(eq=False, repr=False)
class Workspace:
    """Loads tree files, each with the settings of its project.

    Attributes:
        additions: The user's additions.
        read: Reads one tree file; an editor provides the text of open ones.
        note: Called once for each thing that is ignored for safety.
    """

    additions: Additions = Additions()  # noqa: RUF009 - cannot be changed
    read: Read = read_tree_file
    note: Callable[[str], None] = lambda _text: None
    _projects: dict[tuple[Path | None, ...], Project] = field(default_factory=dict, init=False)
    _files_around: dict[tuple[Path | None, ...], FilesAround] = field(default_factory=dict, init=False)
    _noted: set[str] = field(default_factory=set, init=False)

    def load(self, tree: str | Path) -> "LoadedTree":
        """Load a tree.

        Args:
            tree: The path of a tree file, or the name of a shipped tree.

        Raises:
            UnreadableFileError: If the file does not exist or cannot be read.
            TreeError: If the project's configuration has mistakes.
        """
        return self.load_file(find_tree(str(tree)))

    def load_file(self, path: Path) -> "LoadedTree":
        """Load a tree file.

        Raises:
            UnreadableFileError: If the file does not exist or cannot be read.
            TreeError: If the project's configuration has mistakes.
        """
        return LoadedTree(path, self.project_of(path), self.read, self._note)

    def project_here(self) -> Project:
        """Return the project of tree files in the current folder; see `project_of`."""
        return self.project_of(Path("a tree file"))

    def project_of(self, path: Path) -> Project:
        """Return the project of a tree file.

        Raises:
            UnreadableFileError: If its configuration cannot be read.
            TreeError: If the configuration has mistakes.
        """

        def pass_over(foreign: Path) -> None:
            self._note(f"{foreign} is passed over: it belongs neither to you nor to the owner of {path}")

        folders, is_isolated = self.additions.folders, self.additions.is_isolated
        found = find_surroundings(path, folders, pass_over, is_isolated=is_isolated)
        configuration, checkout, files = found
        key = (configuration.path, checkout, files.folder, files.root)
        if key not in self._projects or self._projects[key].configuration != configuration:
            around = self._files_around.setdefault((files.folder, files.root), files)
            self._projects[key] = Project(found._replace(files=around), self.additions, self.read)
            for entry_point, place in ignored_entry_points(ENTRY_POINTS, checkout):
                self._note(
                    f"the leaves of '{entry_point.value}' are passed over: {place} says that they are installed, "
                    f"but is part of what is looked at; install them, or say --nodes {entry_point.value}"
                )
        return self._projects[key]

    def renew_sets(self) -> None:
        """Have the files of all sets read anew: some have changed."""
        for project in self._projects.values():
            project.renew_set()

    def note_use(self) -> None:
        """Note which palettes and trees around the files that were looked at have been used, though nobody has named them."""
        projects = self._projects.values()
        palettes = dict.fromkeys(path for each in projects for path in each.used_palettes)
        trees = dict.fromkeys(path for each in projects for path in each.used_trees)
        for what, paths in (("nodes are described by", palettes), ("trees are taken from", trees)):
            if paths:
                more = f" and {len(paths) - _MOST_NAMED} more" if len(paths) > _MOST_NAMED else ""
                listed = ", ".join(map(str, sorted(paths)[:_MOST_NAMED]))
                self._note(f"{what} {listed}{more}")

    def _note(self, text: str) -> None:
        if text not in self._noted:
            self._noted.add(text)
            self.note(text)


class LoadedTree:
    """A tree file with all that it includes, and the settings of its project.

    Args:
        path: The file.
        project: The settings of its project.
        read: Reads one tree file.
        note: Is told what is surprising, but no mistake.

    Raises:
        UnreadableFileError: If the file does not exist or cannot be read.
    """

    def __init__(self, path: Path, project: Project, read: Read, note: Callable[[str], None]) -> None:
        self.path = path
        self.project = project
        self._note = note
        self._forest: Forest | None = None
        self._malformed: tuple[Diagnostic, ...] = ()
        self._beginning: FileBeginning | None = None
        self._read = read
        try:
            self._forest = load_forest(path, read, project.include_path, project.tree_set)
            project.note_use(self._forest)
        except TreeError as error:
            self._malformed, self._beginning = error.findings, error.beginning

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.path}>"

    def _repr_svg_(self) -> str | None:
        """Return a picture for a notebook; None, so that it shows the text, if the file is malformed."""
        from sar_compiler.views.drawing import svg

        try:
            return svg(self.sketch())
        except TreeError:
            return None

    @property
    def is_malformed(self) -> bool:
        """Whether the file cannot be understood at all."""
        return self._forest is None

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
        """The content of the file itself; if it is malformed, of its beginning, or None."""
        if self._forest is not None:
            return self._forest.main
        return self._beginning.tree_file if self._beginning is not None else None

    @property
    def source(self) -> Source:
        """The text of the file."""
        return self._forest.main.source if self._forest is not None else self._malformed[0].source

    @functools.cached_property
    def findings(self) -> list[Diagnostic]:
        """The findings about the file and those that it includes, with the project's severities."""
        if self._forest is None:
            return self._findings_before()
        decide = self.project.configuration.decide
        found = check_context(self.context)
        return decide(first_of_each(decide(found)))

    @functools.cached_property
    def context(self) -> CheckContext:
        """The file with all that is known of it.

        Raises:
            SarError: As `Project.registry` and `palettes` do.
        """
        project = self.project
        return context_of(self.forest, project.registry, self.palettes, project.configuration.btcpp)

    @functools.cached_property
    def palettes(self) -> tuple[TreeFile, ...]:
        """The palettes that are files, without what is one of the files itself.

        Raises:
            UnreadableFileError: If a palette does not exist or cannot be read.
            TreeError: If the file, or a palette that somebody has named, is malformed.
        """
        return self.project.palettes_for(self.forest)

    def _findings_before(self) -> list[Diagnostic]:
        """Return the findings about a malformed file: where it is that, and what is wrong before."""
        found, project = list(self._malformed), self.project
        if self._beginning is not None:
            beginning, own = self._beginning, real_path(self.path)

            def read(path: Path) -> TreeFile:
                return beginning.tree_file if real_path(path) == own else self._read(path)

            forest = load_forest(self.path, read, project.include_path, project.tree_set)
            found = [each for each in found if each.severity is Severity.ERROR]
            cut = min(each.span for each in found)
            palettes = project.palettes_for(forest)
            found += check_beginning(beginning, cut, forest, project.registry, palettes)
        return project.configuration.decide(sorted(found, key=lambda each: each.span))

    def check(self) -> list[Diagnostic]:
        """Return all findings about the palettes, the file, the files that it includes, and whose mission it is.

        Raises:
            TreeError: If a palette is malformed, or the configuration names modules that are not trusted.
            UnreadableFileError: If a palette cannot be read.
            MissionError: If there is no mission of the name that the user has given, or one cannot be imported.
        """
        return [*self._findings_of_the_tree, *self.mission_findings]

    @property
    def _findings_of_the_tree(self) -> list[Diagnostic]:
        return [*self.project.findings, *self.findings]

    @functools.cached_property
    def mission_findings(self) -> list[Diagnostic]:
        """The findings about the mission of the tree that the file executes; none for a file with errors.

        Raises:
            MissionError: If there is no mission of the name that the user has given, or one cannot be imported.
        """
        project = self.project
        # The only one is never imported to ask whose a tree is.
        if project.additions.mission is None and len(entry_points(MISSIONS, project.checkout)) < 2:  # noqa: PLR2004
            return []
        try:
            binding = self.binding()
        except TreeError:  # there is no such tree, or it has been said already what is wrong with it
            return []
        try:
            self.mission(binding)
        except TreeError as error:
            return project.configuration.decide([*error.findings])
        return []

    def mission(self, binding: Binding) -> "Mission | None":
        """Return the mission of a bound tree; None for a plain tree.

        Raises:
            MissionError: If there is no mission of the name that the user has given, or one cannot be imported.
            TreeError: If the leaves require the objects of several missions.
        """
        from sar_compiler.missions.choosing import choose_mission

        return choose_mission(binding, self.project.additions.mission, self.project.checkout)

    def binding(self, tree_id: str | None = None) -> Binding:
        """Return a tree of the file, bound.

        Args:
            tree_id: The tree; by default the one that the file executes.

        Raises:
            TreeError: If there is none, or there are errors; carries them.
        """
        from sar_compiler.compiler import bind_main

        self._require_no_errors()
        return bind_main(self.forest, self.project.registry, tree_id, self.palettes)

    def try_runs(self, budget: "Callable[[], TrialBudget]") -> list[Diagnostic]:
        """Return findings about ticks that raise, as far as a budget goes; none for a file with errors.

        A tree whose ticks raise nothing, since it has neither keys nor scripts, is not even compiled.

        Args:
            budget: Returns how much may be tried of the file; called only where there is something to try.
        """
        if self._forest is None or any(
            each.severity is Severity.ERROR for each in self._findings_of_the_tree
        ):
            return []
        executable = self._forest.executable
        if not executable or not any(map(self._may_raise, self._forest.iterate())):
            return []
        from sar_compiler.project.proof import try_runs

        limit, is_chosen = budget(), self._forest.main_tree() is None
        # What a rule has found in the same place is the same mistake, and so is what another tree's run has.
        told = {(each.source.path, each.span) for each in self.findings if each.severity is not Severity.INFO}
        raised = []
        for number, element in enumerate(executable):
            limit.allot(len(executable) - number)
            tree_id = element.attributes.get("ID") if is_chosen else None
            chosen = "" if tree_id is None else f" --tree {shlex.quote(tree_id)}"
            try:
                binding = self.binding(tree_id)
            except TreeError:
                continue
            for finding in try_runs(self, binding, limit, f"sar-compile verify{chosen}"):
                place = finding.source.path, finding.span
                raised += [finding] if place not in told else []
                told.add(place)
        return self.project.configuration.decide(raised)

    def _may_raise(self, tree: Element) -> bool:
        """Return whether a tree has keys or scripts, which have values only in a run."""
        return any(
            "{" in text or name in CONDITIONS or self._is_script(element.tag, name)
            for element in tree.iterate()
            for name, text in element.attributes.items()
        )

    def _is_script(self, tag: str, name: str) -> bool:
        parameters = (spec.parameters.get(name) for spec in self.project.registry.variants(tag))
        return any(each is not None and each.value_type.python is Script for each in parameters)

    def _require_no_errors(self) -> None:
        errors = [each for each in self._findings_of_the_tree if each.severity is Severity.ERROR]
        if errors:
            raise TreeError(errors)

    def report_warnings(self, findings: Iterable[Diagnostic]) -> None:
        """Report findings about a file beside the tree with which it can be used."""
        for finding in findings:
            self._note(finding.render())

    def _start_values(self, params: "str | Path | StartValues | None", binding: Binding) -> "StartValues":
        """Return what a parameter file says of the runs of a tree, without ROS; what is surprising in it is noted.

        Raises:
            ParameterFileError: If ROS would refuse or misread the file.
            ParameterError: If the mission cannot begin with the parameters.
        """
        from sar_compiler.checks.assumptions import StartValues

        if params is None or isinstance(params, StartValues):
            return params or StartValues()
        values, _, begun = self._begun(Path(params), binding)
        for text in begun.notes:
            self._note(text if text.startswith(f"{params}:") else f"{params}: {text}")
        return StartValues(values, begun.mission.facts(), 1.0 / begun.parameters.tick_rate_hz)

    def _begun(
        self, params: Path | None, binding: Binding
    ) -> "tuple[dict[str, object], ParameterReader, Beginning]":
        """Begin a run with the parameters of a file, without ROS; return what the file says, and what was read of it."""
        from sar_compiler.missions.beginning import begin_run, node_name
        from sar_compiler.ros.parameter_file import read_parameter_file
        from sar_compiler.ros.parameter_reader import ParameterReader

        mission = self.mission(binding)
        node = f"/{node_name(mission)}"
        values = read_parameter_file(params, node) if params is not None else {}
        reader = ParameterReader.of_files(values, [] if params is None else [params], node)
        return values, reader, begin_run(mission, reader, binding)

    def read_parameters(self, params: Path | None = None, tree_id: str | None = None) -> "ParameterReader":
        """Return the parameters with which `sar-run` runs a tree, and the files that they name, read without ROS.

        Args:
            params: The parameter file; by default that of the mission, if it has one.
            tree_id: The tree in the file; by default the one that the file executes.

        Raises:
            TreeError: If there are errors.
            ParameterFileError, ParameterError: If the mission cannot begin with the parameters.
        """
        binding = self.binding(tree_id)
        mission = self.mission(binding)
        if params is None and mission is not None:
            params = mission.default_parameters()
            if params is not None:
                admit(params)
        return self._begun(params, binding)[1]

    def stage(self, tree_id: str | None = None, params: "str | Path | StartValues | None" = None) -> "Stage":
        """Return the stage on which scenarios are played.

        Args:
            tree_id: The tree that is played if a scenario names none; by default the one that the file executes.
            params: The mission's ROS parameter file, or what it says; by default, leaves say what facts are at the start.

        Raises:
            TreeError: If there are errors.
        """
        from sar_compiler.checks.simulate.scenario_files import Stage

        self._require_no_errors()
        start = functools.partial(self._start_values, params)
        return Stage(self.forest, self.project.registry, self.palettes, tree_id, start)

    def compile(
        self,
        *,
        node: "Node | None" = None,
        parameters: Mapping[str, object] | None = None,
        context: Mapping[type, object] | None = None,
        tree_id: str | None = None,
    ) -> "CompiledTree":
        """Compile a tree, to be ticked.

        Args:
            node: The node that it will be ticked on: its clock is the tree's, its parameters are keys of the root
                blackboard. Without a node, the steady clock is used.
            parameters: Further keys of the root blackboard; they override the node's parameters.
            context: Objects that leaves require in their constructors, by their type.
            tree_id: The tree in the file; by default the one that the file executes.

        Raises:
            TreeError: If there are errors, a key has no value or an invalid one, a leaf needs an object that is
                not in *context*, or a constructor refuses its arguments.
        """
        from sar_compiler.compiler import compile_tree
        from sar_compiler.runtime.clock import Clock

        binding = self.binding(tree_id)
        of_node: dict[str, object] = {}
        clock: dict[type, object] = {}
        if node is not None:
            from sar_compiler.ros.clock import mission_clock
            from sar_compiler.ros.parameters import flat_parameters

            of_node, clock = flat_parameters(node), {Clock: mission_clock(node)}
        return compile_tree(binding, {**clock, **(context or {})}, {**of_node, **(parameters or {})})

    def preview(self, tree_id: str | None = None) -> "CompiledTree":
        """Compile a tree for display, with stand-ins for the objects of a mission.

        Raises:
            TreeError: If there are errors.
        """
        from sar_compiler.compiler import preview_tree

        return preview_tree(self.binding(tree_id))

    def sketch(self, tree_id: str | None = None) -> "Drawable":
        """Return a tree of the file for a drawing, whatever is wrong with the file.

        A tree without errors is compiled as by `preview`. Of any other, unknown nodes have no meaning, and subtrees that are
        nowhere are folded.

        Args:
            tree_id: The tree in the file; by default the one that the file executes, or the first that no other one uses.

        Raises:
            TreeError: If there is no such tree, the file is malformed, or its project's configuration has mistakes.
        """
        from sar_compiler.nodes.binding.tree_ids import find_main_tree
        from sar_compiler.views.sketch import sketch_tree

        forest = self.forest
        candidates = (*forest.executable, *forest.main.trees)
        element = forest.main_tree(tree_id) or (candidates[0] if candidates and tree_id is None else None)
        if element is None:
            find_main_tree(forest, tree_id)
        is_main = element is forest.main_tree(tree_id)
        try:
            return self.preview(tree_id if is_main or element is None else element.attributes.get("ID"))
        except TreeError as error:
            trees = self.context.bound.trees
            sketch = sketch_tree(next(each for each in trees if each.element is element), trees)
            return replace(sketch, findings=error.findings)

    def simulate(
        self,
        *,
        leaves: Mapping[str, object] | None = None,
        scenario: Mapping[str, object] | None = None,
        **scripts: object,
    ) -> "Simulated":
        """Return the tree with scripted leaves, to be ticked on a manual clock.

        The arguments correspond to a scenario file, with Python's lists and dictionaries for YAML's.

        Args:
            leaves: The answers of leaves, by path, name or tag: `{"Patrol/NavigateToZone": ["aborted", "arrived"]}`.
            scenario: The other keys of a scenario: `{"tree": "Main", "facts": {"zones_left": 1}, "period": "0.1s"}`.
            **scripts: The answers of leaves whose names are Python identifiers: `NavigateToZone=["aborted", "arrived"]`.

        Raises:
            TreeError: If there are errors, or the script has an answer that a leaf never gives.
        """
        from sar_compiler.project.simulated import simulate_tree

        return simulate_tree(self, {**(scenario or {}), "leaves": {**(leaves or {}), **scripts}})

    def default_properties(self, tree_id: str | None = None) -> Path | None:
        """Return the file of the properties that `verify` checks if none is named; None for none.

        Raises:
            TreeError: If there are errors.
        """
        from sar_compiler.project.proof import default_properties

        return default_properties(self, self.binding(tree_id))

    def verify(
        self,
        properties: str | Path | None = None,
        *,
        facts: "Mapping[str, object] | Document | None" = None,
        params: str | Path | None = None,
        tree_id: str | None = None,
        max_states: int = 1_000_000,
        budget: "Budget | None" = None,
        keep_states: bool = False,
    ) -> "Verification":
        """Check properties in all possible runs of the tree.

        Args:
            properties: A file with the properties; by default the mission's own.
            facts: The initial values of facts, in addition to the file's: `{"zones_left": 4}`.
            params: The mission's ROS parameter file; *properties* and *facts* override what it says.
            tree_id: The tree in the file; by default the one that the file executes.
            max_states: The largest number of states to explore.
            budget: Limits time and memory, and is told the progress; by default there is no limit but that of states.
            keep_states: Whether the result has all states, as `space`.

        Raises:
            TreeError: If there are errors, or a property makes no sense for the tree.
            UndecidableError: If the runs of the tree cannot be enumerated.
            ParameterFileError, ParameterError: If the mission cannot begin with the parameters.
        """
        from sar_compiler.checks.verify import verify
        from sar_compiler.project.proof import verify_tree

        binding = self.binding(tree_id)
        start = self._start_values(params, binding)
        search = functools.partial(verify, max_states=max_states, budget=budget, keep_states=keep_states)
        return verify_tree(self, binding, properties, facts, start, search)

    def watch(
        self,
        watched: "CompiledTree",
        properties: str | Path | None = None,
        *,
        facts: Mapping[str, Fact] | None = None,
        parameters: Mapping[str, object] | None = None,
        tree_id: str | None = None,
        clock: Callable[[], float] = lambda: 0.0,
    ) -> "PropertyWatch":
        """Return what watches a run of the tree for properties.

        Args:
            watched: The tree that is ticked.
            properties: As for `verify`.
            facts: The facts as they are when the run begins; they override what the file says.
            parameters: The keys of the root blackboard.
            tree_id: As for `verify`.
            clock: Returns the time, seconds since the run began.

        Raises:
            TreeError, UndecidableError: As `verify`.
        """
        from sar_compiler.project.proof import watch_tree

        return watch_tree(
            self, self.binding(tree_id), properties, watched, facts or {}, parameters or {}, clock
        )

    def conform(
        self,
        record: "Iterable[Event]",
        names: Sequence[str],
        properties: str | Path | None = None,
        *,
        is_over: bool,
        start: "StartValues",
        facts: "Mapping[str, object] | Document | None" = None,
        params: str | Path | None = None,
        tree_id: str | None = None,
    ) -> "Conformance":
        """Compare a recorded run with all possible runs of the tree.

        Args:
            record: What its leaves did.
            names: The names of the nodes that ran, in pre-order.
            properties: As for `verify`.
            is_over: Whether it is over by its own condition.
            start: The parameters and facts with which it began; *facts* override them, and they override what files say of facts.
            facts: As for `verify`.
            params: As for `verify`.
            tree_id: As for `verify`.

        Raises:
            TreeError, UndecidableError, ParameterFileError, ParameterError: As `verify`.
            OtherTreeError: If the tree has nodes other than those that ran.
        """
        from sar_compiler.checks.assumptions import StartValues
        from sar_compiler.checks.conformance import conform
        from sar_compiler.documents.located import Document
        from sar_compiler.project.proof import begin_with, verify_tree

        binding = self.binding(tree_id)
        said = self._start_values(params, binding)
        begun = StartValues({**said.parameters, **start.parameters}, {**said.facts, **start.facts})
        given = facts.root.mapping if isinstance(facts, Document) else facts or {}

        def search(
            simulated: "SimulatedTree", file: "PropertyFile | None", tags: Collection[str]
        ) -> "Conformance":
            begin_with(simulated, {name: value for name, value in start.facts.items() if name not in given})
            return conform(simulated, file, tags, record, names, is_over=is_over)

        return verify_tree(self, binding, properties, facts, begun, search)

    def predict(
        self,
        properties: str | Path | None = None,
        *,
        answers: Iterable[str | Path] = (),
        facts: "Mapping[str, object] | Document | None" = None,
        params: str | Path | None = None,
        tree_id: str | None = None,
        period_sec: float | None = None,
        max_states: int = 1_000_000,
        budget: "Budget | None" = None,
    ) -> "Prediction":
        """Compute how likely the tree is to succeed and to keep its properties, and how long it takes. Needs numpy and scipy.

        Args:
            properties: A file with the properties, and with the chances `p` and times `sec` of answers; by default the mission's own.
            answers: Further files that say how likely answers are; the file of properties overrides them.
            facts: As for `verify`.
            params: As for `verify`.
            tree_id: As for `verify`.
            period_sec: The time between two ticks, seconds; by default that of *params*, or half a second.
            max_states: As for `verify`; what is behind the others may be anything, so the numbers have wider bounds.
            budget: As for `verify`.

        Raises:
            TreeError, UndecidableError, ParameterFileError, ParameterError: As `verify`.
        """
        from sar_compiler.checks.predict import predict
        from sar_compiler.checks.simulate.scenario_files import PERIOD_SEC
        from sar_compiler.project.proof import verify_tree

        binding = self.binding(tree_id)
        start = self._start_values(params, binding)
        period = period_sec or start.period_sec or PERIOD_SEC
        search = functools.partial(predict, period_sec=period, max_states=max_states, budget=budget)
        return verify_tree(self, binding, properties, facts, start, search, answers)


def load(
    tree: str | Path,
    *,
    nodes: Iterable[Named] = (),
    models: Iterable[str | Path] = (),
    include_path: Iterable[str | Path] = (),
    registry: Registry | None = None,
    mission: str | None = None,
    isolated: bool = False,
) -> LoadedTree:
    """Load a tree file, with the settings of its project's configuration.

    Args:
        tree: The path of a tree file, or the name of a shipped tree (`search_and_rescue`).
        nodes: Leaves of your own: classes, modules, or import paths of modules.
        models: Palettes, which describe nodes that are not installed: files, or names of installed ones (`nav2:jazzy`).
        include_path: Further folders that the file may include from.
        registry: The registered nodes, instead of the installed ones, *nodes* and palettes that are installed.
        mission: The name of the mission, whatever the leaves require; by default it is chosen by them.
        isolated: Whether the surroundings of the file are ignored: configuration, palettes and trees around it.

    Raises:
        UnreadableFileError: If the file does not exist or cannot be read.
        TreeError: If the project's configuration has mistakes. Findings about the tree are returned by `check`, and
            raised by `compile`, `simulate` and `verify`.
        TypeError: If *nodes*, *models* or *include_path* is a single text.
    """
    for name, several in (("nodes", nodes), ("models", models), ("include_path", include_path)):
        if isinstance(several, str):
            raise TypeError(
                f"{name} is the text '{several}'; write several or one in brackets: {name}=['{several}']"
            )
    palettes, folders = (tuple(Path(path) for path in each) for each in (models, include_path))
    additions = Additions(
        tuple(nodes), palettes, folders, registry=registry, mission=mission, is_isolated=isolated
    )
    # The frames between are `_note`, `project_of` and the two `load`.
    return Workspace(additions, note=lambda text: warnings.warn(text, stacklevel=6)).load(tree)

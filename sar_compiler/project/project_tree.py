"""Reads, binds, checks and compiles one tree file with its includes."""

import functools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from sar_compiler.checks import check_beginning, check_context, limit_findings, make_check_context
from sar_compiler.checks.rules import CheckContext
from sar_compiler.nodes.binding.bound import Binding
from sar_compiler.project.project import Project
from sar_compiler.tree.content import real_path
from sar_compiler.tree.diagnostic import Diagnostic, Severity, Source, TreeError
from sar_compiler.tree.forest import Forest, Read, load_forest
from sar_compiler.tree.model import FileBeginning, TreeFile, UnfinishedFileError

if TYPE_CHECKING:
    from sar_compiler.compiler import CompiledTree
    from sar_compiler.compiler.sketch import Drawable

FurtherCheck = Callable[["ProjectTree"], list[Diagnostic]]
"""A function that checks a tree and returns findings. It may need packages that the core does not need."""


class ProjectTree:
    """A tree file with its includes, and the settings of its project.

    Args:
        path: The file.
        project: The settings of its project.
        read: A function that reads one tree file.
        note: A function that receives the text of each note for the user.
        further_checks: Functions that return findings in addition to those of the rules of `checks`.

    Raises:
        UnreadableFileError: If the file does not exist or cannot be read.
    """

    def __init__(
        self,
        path: Path,
        project: Project,
        read: Read,
        note: Callable[[str], None],
        further_checks: Sequence[FurtherCheck] = (),
    ) -> None:
        self.path = path
        self.project = project
        self.note = note
        self._further_checks = further_checks
        self._forest: Forest | None = None
        self._malformed: tuple[Diagnostic, ...] = ()
        self._beginning: FileBeginning | None = None
        self._read = read
        try:
            self._forest = load_forest(path, read, project.include_path, project.tree_set)
            project.report_use(self._forest)
        except TreeError as error:
            self._malformed = error.findings
            self._beginning = error.beginning if isinstance(error, UnfinishedFileError) else None

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.path}>"

    @property
    def is_malformed(self) -> bool:
        """Whether the file cannot be parsed."""
        return self._forest is None

    @property
    def forest(self) -> Forest:
        """The tree file and the files that it includes.

        Raises:
            TreeError: If the file is malformed.
        """
        if self._forest is None:
            raise TreeError(self._malformed)
        return self._forest

    @property
    def tree_file(self) -> TreeFile | None:
        """The content of the tree file. For a malformed file, this is the content before the error, or None."""
        if self._forest is not None:
            return self._forest.main
        return self._beginning.tree_file if self._beginning is not None else None

    @property
    def source(self) -> Source:
        """The text of the file."""
        return self._forest.main.source if self._forest is not None else self._malformed[0].source

    @functools.cached_property
    def findings(self) -> list[Diagnostic]:
        """The findings about the file and its includes. The project's configuration sets their severities."""
        if self._forest is None:
            return self._findings_before_error()
        decide = self.project.configuration.decide
        found = check_context(self.context)
        return decide(limit_findings(decide(found)))

    @functools.cached_property
    def context(self) -> CheckContext:
        """The file and its includes, together with the analysis results that all rules share.

        Raises:
            SarError: As `Project.registry` and `palettes` do.
        """
        project = self.project
        return make_check_context(self.forest, project.registry, self.palettes, project.configuration.btcpp)

    @functools.cached_property
    def palettes(self) -> tuple[TreeFile, ...]:
        """The palette files, except those that are themselves checked.

        Raises:
            UnreadableFileError: If a palette does not exist or cannot be read.
            TreeError: If the file or a named palette is malformed.
        """
        return self.project.palettes_for(self.forest)

    def _findings_before_error(self) -> list[Diagnostic]:
        """Return the findings about a malformed file that concern the part before the syntax error."""
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
        """Return all findings about the palettes, the file and its includes, with those of the further checks.

        Raises:
            TreeError: If a palette is malformed, or the configuration names modules that are not trusted.
            UnreadableFileError: If a palette cannot be read.
            SarError: As the further checks do: a `MissionError` if the user has named a mission that does not exist.
        """
        further = [finding for check in self._further_checks for finding in check(self)]
        return [*self.tree_findings, *further]

    @property
    def tree_findings(self) -> list[Diagnostic]:
        """The findings about the palettes, the file and its includes."""
        return [*self.project.findings, *self.findings]

    def binding(self, tree_id: str | None = None) -> Binding:
        """Bind a tree of the file.

        Args:
            tree_id: The ID of the tree; by default the main tree.

        Raises:
            TreeError: If the tree does not exist, or if there are errors, which the exception contains.
        """
        from sar_compiler.compiler import bind_main

        self.require_no_errors()
        return bind_main(self.forest, self.project.registry, tree_id, self.palettes)

    def require_no_errors(self) -> None:
        """Raise an error if there are any errors in the palettes, in the file or in its includes.

        Raises:
            TreeError: If there is at least one error.
        """
        errors = [each for each in self.tree_findings if each.severity is Severity.ERROR]
        if errors:
            raise TreeError(errors)

    def report_warnings(self, findings: Iterable[Diagnostic]) -> None:
        """Pass warnings about a file that is used with the tree, such as a scenario, to `note`."""
        for finding in findings:
            self.note(finding.render())

    def preview(self, tree_id: str | None = None) -> "CompiledTree":
        """Compile a tree for display, with placeholders for the objects of a mission.

        Raises:
            TreeError: If there are errors.
        """
        from sar_compiler.compiler import preview_tree

        return preview_tree(self.binding(tree_id))

    def compile(
        self,
        *,
        parameters: Mapping[str, object] | None = None,
        context: Mapping[type, object] | None = None,
        tree_id: str | None = None,
    ) -> "CompiledTree":
        """Compile a tree that can be ticked.

        Args:
            parameters: The values of the mission parameters, by key of the root blackboard.
            context: Objects that leaves require in their constructors, by type; the default `Clock` is the steady clock.
            tree_id: The ID of the tree; by default the main tree.

        Raises:
            TreeError: If there are errors, a key has no value or an invalid value, a leaf needs an object that is not
                in *context*, or a constructor rejects its arguments.
        """
        from sar_compiler.compiler import compile_tree

        return compile_tree(self.binding(tree_id), context or {}, parameters or {})

    def sketch(self, tree_id: str | None = None) -> "Drawable":
        """Return a tree of the file that can be drawn, even if the file has errors.

        A tree without errors is compiled as by `preview`. In a tree with errors, unknown nodes are drawn as placeholders,
        and missing subtrees are collapsed.

        Args:
            tree_id: The ID of the tree; by default the main tree or, if the file names none, the first tree that no other
                tree uses.

        Raises:
            TreeError: If there is no such tree, the file is malformed, or the project's configuration has errors.
        """
        from sar_compiler.compiler.sketch import sketch_tree
        from sar_compiler.nodes.binding.nesting import find_main_tree

        forest = self.forest
        candidates = (*forest.executable, *forest.main.trees)
        element = forest.main_tree(tree_id) or (candidates[0] if candidates and tree_id is None else None)
        if element is None:
            find_main_tree(forest, tree_id)
        is_main = element is forest.main_tree(tree_id)
        try:
            return self.preview(tree_id if is_main or element is None else element.attributes.get("ID"))
        except TreeError as error:
            trees = self.context.bound_forest.trees
            # If the main tree is in another file of the set, the first tree of this file is drawn.
            bound = next((each for each in trees if each.element is element), next(iter(trees), None))
            if bound is None:
                raise
            sketch = sketch_tree(bound, trees)
            return replace(sketch, findings=error.findings)

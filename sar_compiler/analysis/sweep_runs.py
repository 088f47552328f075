"""Plays random runs of a scenario in worker processes, and finds the smallest failing scenario."""

import functools
import hashlib
import threading
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import NamedTuple

from sar_compiler.analysis.leaf_vocabulary import EventPattern, LeafVocabulary
from sar_compiler.analysis.simulate.reused_tree import ReusedTree
from sar_compiler.analysis.simulate.scenario_files import ScenarioSimulation, ScenarioStage, load_scenario
from sar_compiler.analysis.simulate.scenario_run import DrawnChoice, Failure, Player, ScenarioPlayer, failures
from sar_compiler.analysis.simulated_tree import SimulatedTree
from sar_compiler.analysis.sweep import RunResultSample
from sar_compiler.analysis.tree_analysis import stage_of
from sar_compiler.documents.yaml_files import as_yaml, document_from_data, parse_yaml
from sar_compiler.errors import SarError, UndecidableError
from sar_compiler.project import CommandLineSettings, ProjectTree, Workspace

# py_trees' blackboard is global to a process, and a worker process may have several threads.
_PLAY_LOCK = threading.Lock()
# The maximum number of runs that the minimisation of a scenario plays.
_MAX_TRIALS = 400


class UndecidedRunError(SarError):
    """Raised if the result of a run depends on an unknown value."""

    exit_status = 1


class ChangedTreeError(SarError):
    """Raised if the files of a tree have changed since the Monte Carlo runs started."""


@dataclass(frozen=True)
class ScenarioRuns:
    """Plays a scenario repeatedly, each time with a different seed.

    Attributes:
        tree: The absolute path of the tree file.
        content: The checksum of the tree (`content_of`); workers reject a tree with another checksum.
        additions: The user's additions to the tree's project.
        scenario: The text of the scenario file.
        path: The name of the scenario file.
        unusual: The probability with which an unscripted leaf returns another outcome than its default outcome.
        counted: The events to count, such as `NotifyBase acknowledged`.
    """

    tree: Path
    content: str
    additions: CommandLineSettings
    scenario: str
    path: str
    unusual: float = 0.0
    counted: tuple[str, ...] = ()

    def __call__(self, seeds: Sequence[int]) -> list[RunResultSample]:
        """Play a run for each seed, and return the results of the runs."""
        with _PLAY_LOCK:
            replays = _cached_runs(self)
            return [replays.outcome(seed) for seed in seeds]

    def understood(self) -> ScenarioSimulation:
        """Load the tree and the scenario.

        Raises:
            TreeError: If the tree or the scenario has errors; contains the findings.
            ChangedTreeError: If the tree's files have changed since the start of the sweep.
        """
        stage = _stage(self.tree, self.content, self.additions)
        return load_scenario(parse_yaml(self.scenario, self.path, ""), stage)

    def has_randomness(self) -> bool:
        """Return whether runs with different seeds can differ."""
        play = self.understood()
        steps = [step for script in play.scenario.scripts.values() for step in script]
        if any(step.probability < 1.0 or step.longest_sec > step.after_sec for step in steps):
            return True
        return bool(self.unusual) or any(leaf.is_random for leaf in play.simulated.leaves)

    def events(self, simulated: SimulatedTree) -> list[EventPattern]:
        """Return the patterns of the events to count.

        Raises:
            TreeError: If the tree does not have one of the events.
        """
        if not self.counted:
            return []
        document = document_from_data({"count": list(self.counted)}, "--count", "")
        words = LeafVocabulary(document, simulated)
        found = [words.parse_event(item) for item in document.root.mapping["count"].as_list]
        document.raise_findings()
        return [each for each in found if each is not None]

    def play(self, seed: int) -> ScenarioPlayer:
        """Play the run with the given seed, and return the player."""
        play = self.understood()
        player = ScenarioPlayer(play.simulated, replace(play.scenario, seed=seed, unusual=self.unusual))
        player.run_to_end()
        return player


class _CachedRuns:
    """Plays runs on a compiled tree. The worker process caches this tree.

    Args:
        runs: The runs to play.
    """

    def __init__(self, runs: ScenarioRuns) -> None:
        self._runs = runs
        self._compile()

    def _compile(self) -> None:
        play = self._runs.understood()
        self._scenario = replace(play.scenario, unusual=self._runs.unusual)
        self._events = self._runs.events(play.simulated)
        try:
            self._tree: ReusedTree | None = ReusedTree(play.simulated)
        except UndecidableError:
            self._tree = None

    def outcome(self, seed: int) -> RunResultSample:
        """Play the run with the given seed, and return the result of the run."""
        player = self._player(seed)
        run, choices = player.run, player.scripted.choices
        if run.is_undecided:
            raise UndecidedRunError(
                f"the success rate is unknown, because the run with seed {seed} cannot be decided: {run.trouble}"
            )
        counts = {each.text: sum(map(each.matches, run.events)) for each in self._events}
        size = (sum(not choice.usual for choice in choices), len(run.ticks), len(choices))
        missed = "; ".join(f"{each.expected}: {each.message}" for each in failures(run))
        return RunResultSample(seed, missed, run.time_sec, counts, size)

    def _player(self, seed: int) -> Player:
        """Play the run with the given seed, and return the player."""
        if self._tree is None:
            return self._runs.play(seed)
        if self._tree.needs_replacement:
            self._compile()
        return self._tree.play(replace(self._scenario, seed=seed))


# The rows of a sweep take turns. If there are more rows than cached trees, trees are compiled again.
_cached_runs = functools.lru_cache(maxsize=16)(_CachedRuns)


def content_of(tree: ProjectTree) -> str:
    """Return one checksum for the texts of a tree file, the included files and the palettes."""
    files = [*tree.forest.files, *tree.forest.others, *tree.palettes]
    return hashlib.sha256("\0".join(file.source.text for file in files).encode()).hexdigest()


@functools.lru_cache
def _stage(path: Path, content: str, additions: CommandLineSettings) -> ScenarioStage:
    tree = Workspace(additions).load(path)
    if content_of(tree) != content:
        raise ChangedTreeError(
            f"{path}, or a file that it uses, has changed since the Monte Carlo runs started"
        )
    return stage_of(tree)


def change_scenario(scenario: Mapping[str, object], changes: Mapping[str, object]) -> str:
    """Return the text of a changed scenario. The changes may concern keys, facts and parameters.

    The expected trace is removed, because random runs have different traces. Without expectations and an end condition,
    the root is expected to succeed.
    """
    content = {**scenario}
    for key, value in changes.items():
        before = content.get(key)
        both = isinstance(before, dict) and isinstance(value, dict)
        content[key] = {**before, **value} if both else value  # type: ignore[dict-item]
    expect = content.pop("expect", {} if "until" in content else {"root": "SUCCESS"})
    if isinstance(expect, dict) and (left := {key: value for key, value in expect.items() if key != "trace"}):
        content["expect"] = left
    return as_yaml(content)


class _Group(NamedTuple):
    """A group of consecutive equal choices for a leaf, which becomes one step of a scenario."""

    leaf: str
    step: Mapping[str, object]


def smallest_scenario(runs: ScenarioRuns, seed: int) -> str | None:
    """Return a minimal scenario that reproduces the failure of a run without random choices.

    Args:
        runs: The runs.
        seed: The seed of a run that has failed.

    Returns:
        The text of the scenario file; None if no scenario reproduces the failure, for example because leaves share a path.
    """
    player = runs.play(seed)
    content = parse_yaml(runs.scenario, runs.path, "").root.data
    missed = failures(player.run)
    trials = iter(range(_MAX_TRIALS))

    def script_of(groups: Sequence[_Group]) -> str:
        leaves: dict[str, list[object]] = {}
        for group in groups:
            leaves.setdefault(group.leaf, []).append(group.step)
        name = f"{content.get('name', Path(runs.path).stem)}, seed {seed}"
        return as_yaml({**content, "name": name, "leaves": leaves})

    def fails(groups: Sequence[_Group]) -> bool:
        again = replace(runs, scenario=script_of(groups), unusual=0.0).play(0)
        return _failed_expectations(failures(again.run)) == _failed_expectations(missed)

    groups = _group_choices(player)
    if not fails(groups):
        return None
    size = len(groups)
    while size:
        for start in reversed(range(0, len(groups), size)):
            fewer = groups[:start] + groups[start + size :]
            if next(trials, None) is not None and fails(fewer):
                groups = fewer
        size //= 2
    return script_of(groups)


def _failed_expectations(missed: Sequence[Failure]) -> list[str]:
    return [each.expected for each in missed]


def _group_choices(player: ScenarioPlayer) -> list[_Group]:
    """Return the choices of a run, grouped by leaf. Combine repeated choices of a leaf."""
    leaves = player.run.simulated.leaves
    names = Counter(word for leaf in leaves for word in {leaf.name, leaf.tag})
    by_leaf: dict[str, list[DrawnChoice]] = {}
    for choice in player.scripted.choices:
        leaf = choice.leaf
        key = leaf.name if names[leaf.name] == 1 else "/".join(leaf.path)
        by_leaf.setdefault(key, []).append(choice)
    return [
        _create_group(key, list(same)) for key, choices in by_leaf.items() for _, same in groupby(choices)
    ]


def _create_group(key: str, same: Sequence[DrawnChoice]) -> _Group:
    step: dict[str, object] = {"outcome": same[0].outcome}
    if same[0].after_sec:
        step["after"] = same[0].after_sec
    if len(same) > 1:
        step["times"] = len(same)
    return _Group(key, step)

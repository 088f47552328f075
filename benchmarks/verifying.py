"""What going through all states of a tree costs, beside SPIN on a model of the same tree, and how far it goes.

SPIN is Debian's (`apt install spin`), which generates C for one model; its compilation is not counted, nor is ours of the tree.
The model, `search_and_rescue.pml`, is the tree written by hand with the same answers, and a tick is one step of it.
So a state and a step are comparable in size; SPIN's has 30 states a zone, ours 37, and it asks no question about
endings, for which ours keeps every step. It gets more zones, and rates are compared.
"""

import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from benchmarks import binary_tree
from benchmarks.figures import (
    LOOP,
    Effort,
    Missing,
    Result,
    alone,
    compared,
    cpu_of_children,
    in_turns,
    loop,
    memory_now,
    plain,
)
from benchmarks.trees import around, document, sequence
from sar_compiler.analysis.simulated_tree import Assumptions, compile_simulated
from sar_compiler.analysis.verify import verify
from sar_compiler.analysis.verify.properties import read_property_file
from sar_compiler.budget import Budget, Progress
from sar_compiler.compiler import bind_main
from sar_compiler.nodes.registry import default_registry
from sar_compiler.resources import shipped
from sar_compiler.tree.forest import load_forest
from sar_compiler.tree.gathering import read_tree_file

PLAIN_TREE, RESILIENT = "search_and_rescue", "search_and_rescue_resilient"
SPIN = "SPIN"
PATIENCE_SEC = 100
LEVELS = (5, 7, 9, 10, 12)
RESILIENT_UNFORGOTTEN = f"{RESILIENT}, 4 zones, nothing forgotten"
RESILIENT_FORGOTTEN = f"{RESILIENT}, 4 zones"
MEMORY = f"{RESILIENT}, 9 zones, memory"
RETRIED = "200 retried leaves in a Sequence"
NAV2_SHAPE = "a tree of Nav2's shape"
BRANCHES = (4, 5, 6, 20)
EIGHT_ZONES = f"{RESILIENT}, 8 zones"
_MODEL = Path(__file__).with_name("search_and_rescue.pml")
_ZONES = 1_000
# SPIN is so fast that its start counts with fewer.
_ZONES_OF_SPIN = 20_000
_ENOUGH = 1_000_000
_STATES_FOR_MEMORY = 100_000
_LEAVES = 200
_OF_A_BRANCH = "properties: {one after the other: {before: b1 starts, comes: a1 SUCCESS}}"
# A search is repeated as long as all of them together take no longer.
_REPEATED_SEC = 8.0


class Search(NamedTuple):
    """What a search has come to.

    Attributes:
        states: How many states it has found.
        steps: How many steps between them.
        seconds: CPU seconds of all its processes.
    """

    states: int
    steps: int
    seconds: float


def binary_subject(levels: int) -> str:
    """Return what BehaVerify's tree is called in the tables."""
    return f"BehaVerify's binary tree, L = {levels}, {binary_tree.nodes(levels):,} nodes"


def parallel_subject(count: int) -> str:
    """Return what a tree of so many guarded branches is called in the tables."""
    return f"{count} guarded branches, two leaves each, retried"


def measure(effort: Effort) -> Iterator[Result]:
    """Yield the figures of searches in a process, and of the command."""
    yield from _beside_spin(effort)
    for name, forgets in ((RESILIENT_UNFORGOTTEN, False), (RESILIENT_FORGOTTEN, True)):
        searches: list[Search] = []
        loops: list[float] = []
        while not searches or _goes_on(searches, effort):
            searches.append(alone(_searched, RESILIENT, 4, effort.size(_ENOUGH), forgets=forgets))
            loops.append(loop())
        yield from _of_search(name, searches, {LOOP: loops})
        yield plain(f"{name}: states", searches[0].states, "states")
    yield plain(MEMORY, alone(_bytes_a_state, effort.size(_STATES_FOR_MEMORY)), "bytes/state")
    with tempfile.TemporaryDirectory() as folder:
        yield from _commands(Path(folder), effort)


def _goes_on(searches: Sequence[Search], effort: Effort) -> bool:
    taken = sum(search.seconds for search in searches)
    return len(searches) < effort.few and taken + searches[0].seconds < _REPEATED_SEC


def _of_search(
    name: str, searches: Sequence[Search], references: Mapping[str, Sequence[float]]
) -> Iterator[Result]:
    """Yield what a state takes."""
    yield from compared(name, [each.seconds / each.states for each in searches], references, "s/state")


def _searched(
    tree: str, zones: int, most: int, *, forgets: bool, sizes: dict[int, int] | None = None
) -> Search:
    """Search the states of a shipped tree.

    Args:
        tree: Its name.
        zones: How many zones there are at the start.
        most: How many states to find at most.
        forgets: Whether states are the same that differ only in how nodes have ended.
        sizes: Is filled with the memory that the process has, in bytes, by the number of states.
    """
    registry = default_registry()
    binding = bind_main(load_forest(Path(shipped("trees", f"{tree}.xml")), read_tree_file), registry)
    simulated = compile_simulated(binding, {}, Assumptions({"zones_left": zones}))
    properties = read_property_file(Path(shipped("config", "mission_properties.yaml")))
    tags = {spec.tag for spec in registry if spec.kind.is_leaf}

    def note(progress: Progress) -> None:
        if sizes is not None:
            sizes[progress.states] = memory_now()

    start = time.process_time() + cpu_of_children()
    found = verify(simulated, properties, tags, most, Budget(on_progress=note), forgets=forgets)
    return Search(found.states, found.steps, time.process_time() + cpu_of_children() - start)


def _bytes_a_state(most: int) -> float:
    """Return how much the process grows for each state, in bytes, over the second half of a search."""
    sizes: dict[int, int] = {}
    _searched(RESILIENT, 9, most, forgets=False, sizes=sizes)
    # Not behind its end: the states are gone by then.
    last = max(sizes)
    half = min(sizes, key=lambda states: abs(states - last / 2))
    return (sizes[last] - sizes[half]) / (last - half)


def _beside_spin(effort: Effort) -> Iterator[Result]:
    """Yield what a state, and a step, of the shipped tree takes beside SPIN."""
    name = f"{PLAIN_TREE}, {_ZONES:,} zones, nothing forgotten"
    zones = effort.size(_ZONES)
    absent = [program for program in ("spin", "gcc") if shutil.which(program) is None]
    with tempfile.TemporaryDirectory() as folder:
        actions = {"": lambda: alone(_searched, PLAIN_TREE, zones, _ENOUGH, forgets=False)}
        if absent:
            yield Missing(name, SPIN, f"{' and '.join(absent)} is not installed (apt install spin gcc)")
            actions[LOOP] = lambda: Search(1, 1, loop())
        else:
            _compile_model(Path(folder), effort.size(_ZONES_OF_SPIN))
            actions[SPIN] = lambda: _spun(Path(folder))
        taken = in_turns(actions, effort.few)
    ours = taken.pop("")
    for counted, unit in (("states", "s/state"), ("steps", "s/step")):
        yield from compared(
            f"{name}: {counted}",
            [each.seconds / getattr(each, counted) for each in ours],
            {
                against: [each.seconds / getattr(each, counted) for each in theirs]
                for against, theirs in taken.items()
            },
            unit,
        )


def _compile_model(folder: Path, zones: int) -> None:
    for command in (
        ["spin", "-a", f"-DZONES={zones}", str(_MODEL)],
        ["gcc", "-O2", "-o", "pan", "pan.c"],
    ):
        subprocess.run(command, check=True, cwd=folder, stdout=subprocess.DEVNULL)


def _spun(folder: Path) -> Search:
    before = cpu_of_children()
    command = [str(folder / "pan"), "-m1000000"]
    done = subprocess.run(command, check=True, capture_output=True, text=True, cwd=folder)
    counts = [re.search(rf"(\d+) {what}", done.stdout) for what in ("states, stored", "transitions")]
    states, ticks = (int(count[1]) if count else 0 for count in counts)
    return Search(states, ticks, cpu_of_children() - before)


def _commands(folder: Path, effort: Effort) -> Iterator[Result]:
    """Yield what `sar-compile verify` takes, from the shell, beside a loop in Python."""
    for levels in LEVELS if effort.share == 1 else LEVELS[:2]:
        tree, properties = binary_tree.write(levels, folder)
        yield from _command(binary_subject(levels), [str(tree), "--properties", str(properties)], effort)
    branches = BRANCHES if effort.share == 1 else BRANCHES[:1]
    written = {RETRIED: _retried(effort.size(_LEAVES)), NAV2_SHAPE: _nav2_shape()}
    path, properties = folder / "written.xml", folder / "of_a_branch.yaml"
    properties.write_text(_OF_A_BRANCH, encoding="utf-8")
    for name, text in {**written, **{parallel_subject(count): _guarded(count) for count in branches}}.items():
        path.write_text(text, encoding="utf-8")
        asked = [] if name in written else ["--properties", str(properties)]
        yield from _command(name, ["--model", "nav2:jazzy", str(path), *asked], effort)
    if effort.share == 1:
        zones = ["--set", "zones_left=8", "--max-states", "100000000"]
        yield from _command(EIGHT_ZONES, [RESILIENT, *zones], effort)


def _retried(count: int) -> str:
    """Return a tree with leaves that are tried until they succeed."""
    leaf = '<RetryUntilSuccessful num_attempts="-1"><Try name="n{0}"/></RetryUntilSuccessful>'
    return _described(sequence(leaf.format(number) for number in range(count)))


def _guarded(count: int) -> str:
    """Return a tree with branches that run at the same time as long as a condition holds."""
    branch = sequence(['<Try name="a{0}"/>', '<Try name="b{0}"/>'])
    retried = around('RetryUntilSuccessful num_attempts="3"', [branch])
    branches = (retried.format(number) for number in range(count))
    parallel = around(f'Parallel success_count="{count}" failure_count="1"', branches)
    return _described(around("ReactiveSequence", ["<Check/>", parallel]))


def _nav2_shape() -> str:
    """Return a tree of the shape of those that Nav2 navigates with: planned again now and then, with recoveries of its parts and of the whole."""

    def recovered(retries: int, *nodes: str) -> str:
        return around(f'RecoveryNode number_of_retries="{retries}"', nodes)

    planning = around(
        'RateController hz="1.0"', [recovered(1, '<Try name="plan"/>', '<Try name="clear_plan"/>')]
    )
    driving = recovered(1, '<Try name="drive"/>', '<Try name="clear_drive"/>')
    clearing = sequence(['<Try name="clear_local"/>', '<Try name="clear_global"/>'])
    turns = around(
        "RoundRobin", [clearing, '<Try name="spin"/>', '<Try name="wait"/>', '<Try name="back_up"/>']
    )
    recovering = around("ReactiveFallback", ["<Check/>", turns])
    return _described(recovered(6, around("PipelineSequence", [planning, driving]), recovering))


def _described(body: str) -> str:
    """Return a file with one tree, and what its leaves are."""
    palette = '<TreeNodesModel><Action ID="Try"/><Condition ID="Check"/></TreeNodesModel>\n</root>'
    return document(body).replace("</root>", palette)


def _command(name: str, arguments: Sequence[str], effort: Effort) -> Iterator[Result]:
    command = [str(Path(sys.executable).with_name("sar-compile")), "verify", "--format", "json", *arguments]
    seconds: list[float] = []
    loops: list[float] = []
    try:
        while not seconds or (len(seconds) < effort.few and sum(seconds) < _REPEATED_SEC):
            seconds.append(_to_the_end(command))
            loops.append(loop())
    except subprocess.TimeoutExpired:
        yield Missing(name, "", f"not done in {PATIENCE_SEC} s")
        return
    yield from compared(name, seconds, {LOOP: loops})


def _to_the_end(command: Sequence[str]) -> float:
    """Return the CPU seconds of a search and of its processes.

    Raises:
        TimeoutExpired: If it takes too long.
    """
    before = cpu_of_children()
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, start_new_session=True
    )
    try:
        printed, _ = process.communicate(timeout=PATIENCE_SEC)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        raise
    assert '"complete": true' in printed, printed
    return cpu_of_children() - before

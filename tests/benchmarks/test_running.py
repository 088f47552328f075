"""Measuring: in turns, beside other libraries, and whatever fails on the way."""

import sys
from pathlib import Path

import pytest

import sar_compiler
from benchmarks import binary_tree, peer, peers, running
from benchmarks.figures import (
    Effort,
    Missing,
    alone,
    compared,
    in_turns,
    memory_now,
    most_memory,
    plain,
)
from benchmarks.leaves import registry_with_leaves
from benchmarks.trees import SHAPES, document
from sar_compiler.compiler import bind_main, compile_tree
from sar_compiler.runtime.kernel.live import LiveTree
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.xml import parse_xml

TRIAL = Effort(rounds=1, share=0.01)


def test_what_is_compared_is_measured_in_turns():
    called = []
    actions = {name: lambda name=name: called.append(name) for name in "ab"}
    assert in_turns(actions, 2) == {"a": [None, None], "b": [None, None]}
    assert called == ["a", "b", "a", "b"]


def test_a_figure_is_the_median_of_the_ratios_of_each_round():
    (figure,) = compared("it", [2.0, 30.0, 8.0], {"another": [1.0, 10.0, 2.0]})
    assert (figure.ratio, figure.low, figure.high, figure.ours) == (3.0, 2.5, 3.5, 8.0)


def test_a_gauge_that_shows_nothing_fails():
    with pytest.raises(ValueError, match=r"memory: 0\.0 bytes/state is no figure"):
        plain("memory", 0.0, "bytes/state")


def growth_of(size: int) -> int:
    before = memory_now()
    kept = b"x" * size
    grown = memory_now() - before
    assert len(kept) == size
    assert most_memory() >= before + grown
    return grown


def test_the_memory_of_a_process_is_its_own_and_not_that_of_the_one_that_has_started_it():
    held = b"x" * 300_000_000
    size = 20_000_000
    assert size * 0.9 < alone(growth_of, size) < size * 1.5
    assert alone(most_memory) < len(held)


@pytest.fixture
def own_python(monkeypatch):
    """The Python of the tests in place of that of the peers: it has py_trees, and not behaviortreepy."""
    monkeypatch.setattr(peers, "PYTHON", Path(sys.executable))


@pytest.mark.parametrize("shape", sorted(SHAPES.keys() - {"mixed", "conditions", "Nav2's shape"}))
def test_py_trees_builds_and_ticks_a_file_that_is_right_for_this_project(shape, tmp_path):
    path = tmp_path / "tree.xml"
    path.write_text(document(SHAPES[shape](20)), encoding="utf-8")
    registry = registry_with_leaves()
    forest = Forest.of(parse_xml(path.read_bytes()))
    live = LiveTree(compile_tree(bind_main(forest, registry), {}, {}).root)
    live.tick()
    tick, root = peer.built(str(path))
    tick()
    assert root.status is live.root.status
    assert len(list(root.iterate())) == len(live.nodes)


@pytest.mark.parametrize(
    ("tree", "lacks"), [("<Inverter><Leaf/></Inverter>", "Inverter"), ('<Leaf _skipIf="true"/>', "_skipIf")]
)
def test_what_py_trees_has_not_is_refused_by_name(tmp_path, tree, lacks):
    path = tmp_path / "tree.xml"
    path.write_text(document(tree), encoding="utf-8")
    with pytest.raises(LookupError, match=f"py_trees has no {lacks}"):
        peer.built(str(path))


def test_another_library_ticks_in_a_process_of_its_own(tmp_path, own_python):
    path = tmp_path / "tree.xml"
    path.write_text(document(SHAPES["wide"](2)), encoding="utf-8")
    with peers.peers(peers.PY_TREES) as started:
        assert started[peers.PY_TREES].load(path) > 0
        assert started[peers.PY_TREES].tick(2) > 0
        with pytest.raises(peers.RefusedError, match="FileNotFoundError"):
            started[peers.PY_TREES].load(tmp_path / "none.xml")


def test_a_library_that_is_not_installed_is_said_to_be_missing(tmp_path, own_python):
    path = tmp_path / "tree.xml"
    path.write_text(document(SHAPES["wide"](2)), encoding="utf-8")
    with (
        peers.peers(peers.COMPILED) as started,
        pytest.raises(peers.RefusedError, match="No module named 'behaviortreepy'"),
    ):
        started[peers.COMPILED].load(path)


def test_without_the_environment_of_the_peers_there_are_none(monkeypatch, tmp_path):
    monkeypatch.setattr(peers, "PYTHON", tmp_path / "python")
    with peers.peers(peers.COMPILED, peers.PY_TREES) as started:
        assert started == {}


def test_what_was_measured_before_a_benchmark_failed_is_kept(monkeypatch):
    def failing(effort):
        yield Missing("it", "", "seen")
        message = f"no more than {effort.rounds} rounds"
        raise RuntimeError(message)

    monkeypatch.setattr(running, "BENCHMARKS", {"failing": failing})
    results, failure = running.results_of("failing", TRIAL)
    assert results == [Missing("it", "", "seen")]
    assert failure.endswith("RuntimeError: no more than 1 rounds\n")


@pytest.mark.parametrize("levels", [1, 4])
def test_the_binary_tree_has_the_published_size_and_is_proved(levels, tmp_path):
    tree, properties = binary_tree.write(levels, tmp_path)
    loaded = sar_compiler.load(tree)
    assert sum(1 for _ in loaded.binding().nodes()) == binary_tree.nodes(levels)
    verification = loaded.verify(properties)
    assert verification.proved
    assert len(verification.verdicts) == 3

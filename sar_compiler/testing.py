"""Helpers for tests of your trees.

A golden test compares a compiled tree with a committed file, so that a review shows every effect of a change to the tree, the
registered nodes or the compiler::

    from sar_compiler.testing import assert_matches_golden

    def test_my_mission_compiles_as_reviewed():
        assert_matches_golden("trees/my_mission.xml", "tests/golden/my_mission.json")

`SAR_RENEW_GOLDEN=1 pytest` rewrites the committed files.

A scripted run tests a tree's behaviour for given outcomes of its leaves, without ROS::

    from sar_compiler.testing import simulate

    def test_a_zone_that_is_not_reached_at_once_is_tried_again():
        run = simulate("trees/my_mission.xml", NavigateToZone=["aborted", "arrived"]).run_to_end()
        run.expect(root="SUCCESS", order=["NavigateToZone aborted", "NavigateToZone arrived"])
"""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path

from sar_compiler.analysis.simulated import Simulated, play_scenario
from sar_compiler.checks.golden import RENEW, compare_golden
from sar_compiler.compiler import CompiledTree
from sar_compiler.compiler.outline import ascii_tree, outline
from sar_compiler.loaded_tree import load
from sar_compiler.nodes.registry import Named, Registry
from sar_compiler.runtime.clock import ManualClock

__all__ = [
    "RENEW",
    "ManualClock",
    "Simulated",
    "assert_matches_golden",
    "assert_scenario_holds",
    "compile_for_test",
    "simulate",
]


def compile_for_test(
    tree: str | Path,
    tree_id: str | None = None,
    registry: Registry | None = None,
    nodes: Iterable[Named] = (),
) -> CompiledTree:
    """Compile a tree file with placeholders for the objects of a mission.

    Args:
        tree: The tree file, or the name of a shipped tree.
        tree_id: The ID of a tree in the file; by default the main tree.
        registry: The known nodes; by default the installed nodes and *nodes*.
        nodes: Your own leaves: classes, modules, or import paths of modules.

    Raises:
        TreeError: If the tree is invalid.
    """
    return load(tree, nodes=nodes, registry=registry).preview(tree_id)


def assert_matches_golden(
    tree: str | Path,
    golden: str | Path,
    tree_id: str | None = None,
    registry: Registry | None = None,
    nodes: Iterable[Named] = (),
) -> None:
    """Compare a compiled tree with a committed file.

    Args:
        tree: The tree file, or the name of a shipped tree.
        golden: The committed file. It contains the output of `sar-compile show --format json` if its suffix is `.json`, otherwise
            the output of `--format ascii`.
        tree_id: The ID of a tree in the file; by default the main tree.
        registry: The known nodes; by default the installed nodes and *nodes*.
        nodes: Your own leaves: classes, modules, or import paths of modules.

    Raises:
        AssertionError: If the committed file does not exist, or the tree differs from it. The message contains the difference.
    """
    result = compile_for_test(tree, tree_id, registry, nodes)
    as_json = Path(golden).suffix == ".json"
    text = (
        json.dumps(outline(result), indent=2, ensure_ascii=False) + "\n"
        if as_json
        else ascii_tree(result.root)
    )
    different = compare_golden(Path(golden), text, f"{tree} (compiled now)")
    if different is not None:
        raise AssertionError(f"the compiled tree differs from the committed file:\n{different}")


def simulate(
    tree: str | Path,
    *,
    registry: Registry | None = None,
    nodes: Iterable[Named] = (),
    leaves: Mapping[str, object] | None = None,
    scenario: Mapping[str, object] | None = None,
    **scripts: object,
) -> Simulated:
    """Return a tree with scripted leaves, for ticking on a manual clock.

    Args:
        tree: The tree file, or the name of a shipped tree.
        registry: The known nodes; by default the installed nodes and *nodes*.
        nodes: Your own leaves: classes, modules, or import paths of modules.
        leaves: The outcomes of leaves, as for `LoadedTree.simulate`.
        scenario: The other keys of a scenario, as for `LoadedTree.simulate`.
        **scripts: The outcomes of leaves whose names are Python identifiers.

    Raises:
        TreeError: If the tree is invalid, or an argument contains an outcome that a leaf cannot have.
    """
    return load(tree, nodes=nodes, registry=registry).simulate(leaves=leaves, scenario=scenario, **scripts)


def assert_scenario_holds(
    tree: str | Path, scenario: str | Path, registry: Registry | None = None, nodes: Iterable[Named] = ()
) -> None:
    """Run a scenario file, and compare the result with the expectations in the file.

    Args:
        tree: The tree file, or the name of a shipped tree.
        scenario: The scenario file.
        registry: The known nodes; by default the installed nodes and *nodes*.
        nodes: Your own leaves: classes, modules, or import paths of modules.

    Raises:
        AssertionError: If an expectation is not met. The message contains the trace.
        TreeError: If the tree or the scenario is invalid.
    """
    play_scenario(load(tree, nodes=nodes, registry=registry), scenario)

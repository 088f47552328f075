"""For tests of your own trees.

A golden test holds a compiled tree against a file that was committed, so that a change of the tree, of
the registry or of the compiler shows in a review::

    from sar_compiler.testing import assert_matches_golden

    def test_my_mission_compiles_as_reviewed():
        assert_matches_golden("trees/my_mission.xml", "tests/golden/my_mission.json")

`SAR_RENEW_GOLDEN=1 pytest` writes the files anew.

A scripted run holds what a tree does against what its leaves answer, without ROS::

    from sar_compiler.testing import simulate

    def test_a_zone_that_is_not_reached_at_once_is_tried_again():
        run = simulate("trees/my_mission.xml", NavigateToZone=["aborted", "arrived"]).until_end()
        run.expect(root="SUCCESS", order=["NavigateToZone aborted", "NavigateToZone arrived"])
"""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path

from sar_compiler.checks.golden import RENEW, difference
from sar_compiler.compiler import CompiledTree
from sar_compiler.nodes.registry import Named, Registry
from sar_compiler.project import load
from sar_compiler.project.simulated import Simulated, play_scenario
from sar_compiler.views.outline import outline
from sar_compiler.views.text import ascii_tree

__all__ = [
    "RENEW",
    "Simulated",
    "assert_matches_golden",
    "assert_scenario_holds",
    "compiled",
    "simulate",
]


def compiled(
    tree: str | Path,
    tree_id: str | None = None,
    registry: Registry | None = None,
    nodes: Iterable[Named] = (),
) -> CompiledTree:
    """Compile a tree file with stand-ins for what only a mission has.

    Args:
        tree: The file, or the name of a shipped tree.
        tree_id: The tree in it; by default the one that the file executes.
        registry: What tags mean; by default everything installed, and *nodes*.
        nodes: Leaves of your own: classes, modules, or import paths of modules.

    Raises:
        TreeError: If the tree is not valid.
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
        golden: The committed file: `.json` holds what `sar-compile show --format json` prints, any other
            ending what `--format ascii` prints.
        tree_id: The tree in the file; by default the one that the file executes.
        registry: What tags mean; by default everything installed, and *nodes*.
        nodes: Leaves of your own: classes, modules, or import paths of modules.

    Raises:
        AssertionError: If they differ, with the difference; or if there is no committed file yet.
    """
    result = compiled(tree, tree_id, registry, nodes)
    as_json = Path(golden).suffix == ".json"
    text = (
        json.dumps(outline(result), indent=2, ensure_ascii=False) + "\n"
        if as_json
        else ascii_tree(result.root)
    )
    different = difference(Path(golden), text, f"{tree} (compiled now)")
    if different is not None:
        message = f"the compiled tree is not the committed one:\n{different}"
        raise AssertionError(message)


def simulate(
    tree: str | Path,
    *,
    registry: Registry | None = None,
    nodes: Iterable[Named] = (),
    leaves: Mapping[str, object] | None = None,
    scenario: Mapping[str, object] | None = None,
    **scripts: object,
) -> Simulated:
    """Return a tree with leaves that answer by a script, to be ticked on a clock that is moved by hand.

    Args:
        tree: The file, or the name of a shipped tree.
        registry: What tags mean; by default everything installed, and *nodes*.
        nodes: Leaves of your own: classes, modules, or import paths of modules.
        leaves: What leaves answer, as for `LoadedTree.simulate`.
        scenario: What else a scenario says, likewise.
        **scripts: What leaves answer, for names that are Python's.

    Raises:
        TreeError: If the tree is not valid, or the script says something of a leaf that it never does.
    """
    return load(tree, nodes=nodes, registry=registry).simulate(leaves=leaves, scenario=scenario, **scripts)


def assert_scenario_holds(
    tree: str | Path,
    scenario: str | Path,
    registry: Registry | None = None,
    nodes: Iterable[Named] = (),
) -> None:
    """Play a scenario's file, and compare with what it expects.

    Args:
        tree: The tree file, or the name of a shipped tree.
        scenario: The scenario's file.
        registry: What tags mean; by default everything installed, and *nodes*.
        nodes: Leaves of your own: classes, modules, or import paths of modules.

    Raises:
        AssertionError: If something does not hold, with the trace.
        TreeError: If the tree or the scenario is not valid.
    """
    play_scenario(load(tree, nodes=nodes, registry=registry), scenario)

"""Tests of the trees of docs/how-to/cover-areas.md that listen to a detector, in the simulator."""

from pathlib import Path

import pytest

from tests.docs.test_sweeping_page import listening_tree, passing_tree

pytestmark = [pytest.mark.ros, pytest.mark.costly]


def run_and_check_conformance(start, tree, place):
    """Run a tree, and check that the run conforms to the tree; return the run."""
    run = start(
        "sar-run",
        tree,
        *("--sim", "offices", "--params", Path("config/search_sweeps_params.yaml").resolve()),
        *("--speed", "40", "--journal", place, "--properties"),
    )
    assert run.end() == 0, run.output
    assert "Mission complete." in run.output
    # The assumptions hold for any number of pieces, although proofs use few pieces.
    assert "Assumption failed" not in run.output
    conforming = start("sar-compile", "conform", tree, place)
    assert conforming.end() == 0, conforming.output
    assert "conforms: it is a possible run of the tree" in conforming.output
    return run


def test_survivor_seen_on_the_way_is_reported_once(start, tmp_path):
    run = run_and_check_conformance(start, listening_tree(tmp_path), tmp_path / "m.journal")
    assert run.log.count("Survivor seen on the way, in office_2!") == 1
    frames = [line for line in run.log if line.startswith("Broadcasting TF frame: ")]
    assert frames == ["Broadcasting TF frame: survivor_1 at (-8.50, 22.50) in map frame."]
    assert run.log.count("Base acknowledged survivor_1.") == 1


def test_pieces_are_passed_without_stop_until_survivor_is_seen(start, tmp_path):
    run = run_and_check_conformance(start, passing_tree(tmp_path), tmp_path / "m.journal")
    assert run.log.count("Survivor seen on the way, in office_2!") == 1
    assert run.log.count("Base acknowledged survivor_1.") == 1
    assert not [line for line in run.log if line.startswith("Calling detect_survivor")]
    drives = [line for line in run.log if line.startswith("Navigating to piece")]
    assert drives
    assert all(line.startswith("Navigating to pieces ") for line in drives)

"""Tests of `sar-run` with trees that belong to no mission: the root decides when and how a run ends."""

import re

import pytest

from tests.trees import document

pytestmark = pytest.mark.ros


@pytest.fixture
def tree(tmp_path):
    """Return a function that writes a tree file."""

    def write(body):
        path = tmp_path / "tree.xml"
        path.write_text(document(body), encoding="utf-8")
        return path

    return write


@pytest.mark.parametrize(
    ("body", "status", "said"),
    [
        ("<AlwaysSuccess/>", 0, ""),
        ('<Delay delay_msec="100"><AlwaysSuccess/></Delay>', 0, ""),
        ("<AlwaysFailure/>", 1, "sar-run: The root of the tree ended with FAILURE."),
        ('<AlwaysSuccess _skipIf="true"/>', 1, "sar-run: The root of the tree ended with SKIPPED."),
    ],
)
def test_run_ends_with_its_root(start, tree, body, status, said):
    run = start("sar-run", tree(body))
    assert run.end() == status
    first, duration, *others = run.output.splitlines()
    assert first == f"Summary: the run {'failed' if status else 'succeeded'}."
    assert re.fullmatch(r"  duration: 0:0\d, \d ticks?", duration)
    assert others == [said] * bool(said)


@pytest.mark.parametrize("executor", ["events", "single-threaded"])
def test_simulated_run_ends_with_its_root_and_starts_no_mission_servers(start, tree, executor):
    run = start("sar-run", tree("<AlwaysSuccess/>"), "--sim", "--executor", executor)
    assert run.end() == 0, run.output
    assert "service ready" not in run.output


def test_each_failure_of_root_is_logged(start, tree):
    run = start(
        "sar-run", tree("<AlwaysFailure/>"), "--until", "success", "--ros-args", "-p", "tick_rate_hz:=50.0"
    )
    run.wait_for("Root FAILURE, starting again (3rd time).")
    status = run.stop()
    assert status == 130
    assert run.log[:3] == [
        f"Root FAILURE, starting again ({number} time)." for number in ("1st", "2nd", "3rd")
    ]


def test_endless_run_continues_after_root_has_ended(start, tree):
    run = start("sar-run", tree('<TickCounter duration="2" completion_status="FAILURE"/>'), "--until", "forever",
                "--view", "text", "--ros-args", "-p", "tick_rate_hz:=50.0")  # fmt: skip
    run.wait_for("TickCounter FAILURE")
    before = run.output.count("TickCounter FAILURE")
    while run.output.count("TickCounter FAILURE") < before + 2:
        run.wait_for("TickCounter FAILURE")
    status = run.stop()
    assert status == 130
    assert run.log == []


def test_missing_service_is_named(start, tree):
    run = start("sar-run", tree("<DetectSurvivor/>"), "--ros-args", "-p", "startup_timeout_sec:=1.0")
    assert run.end() == 3
    assert "service detect_survivor: no server" in run.output


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--until", "complete"], "For this tree, use --until end, success, failure or forever"),
        (["--mission", "serch_and_rescue"], "did you mean 'search_and_rescue'?"),
        (
            ["--sim", "--fault", "report_survivor:drop=1"],
            "unknown target 'report_survivor' (known: navigate_to_pose, amcl)",
        ),
    ],
)
def test_invalid_mission_options_are_rejected(start, tree, arguments, words):
    run = start("sar-run", tree("<AlwaysSuccess/>"), *arguments)
    assert run.end() == 2
    assert words in run.output


def test_mission_option_assigns_tree_to_mission(start, tree):
    run = start("sar-run", tree("<AlwaysFailure/>"), "--mission", "search_and_rescue", "--until", "failure")
    assert run.end() == 1
    assert "Loaded 4 search zones from parameters." in run.log
    assert "the run has ended as requested, but the mission is incomplete" in run.output

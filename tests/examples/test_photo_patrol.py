"""Tests of the example `photo_patrol`: a mission in a separate package, installed and run."""

import json
import shutil
import signal
import subprocess
import sys

import pytest

from tests.examples.readme import EXAMPLES, steps
from tests.faults.self_killing_runs import KILLER
from tests.trees import document

pytestmark = pytest.mark.ros

PATROL = EXAMPLES / "photo_patrol" / "photo_patrol" / "patrol.xml"
STATUSES = [0, 0, 1]


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """Install the package into a separate folder; return the environment variables to find it."""
    folder = tmp_path_factory.mktemp("photo_patrol")
    shutil.copytree(EXAMPLES / "photo_patrol", folder / "source")
    command = [sys.executable, "-m", "pip", "install", "--no-deps", "--disable-pip-version-check", "--target"]
    done = subprocess.run(
        [*command, folder / "site", folder / "source"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return {"PYTHONPATH": str(folder / "site")}


RUNS = [step for step in steps("photo_patrol") if step.commands[0][0] == "sar-run"]


@pytest.mark.costly
@pytest.mark.parametrize(("step", "status"), [*zip(RUNS, STATUSES, strict=True)], ids=str)
def test_run_prints_output_of_readme(start, installed, step, status):
    run = start(*step.commands[0], env=installed)
    assert run.end() == status, run.output
    assert step.shown
    assert step.unseen([run]) == []
    assert "service ready" not in run.output


def test_patrol_tree_has_no_findings(start, installed):
    check = start("sar-compile", "validate", PATROL, env=installed)
    assert check.end() == 0, check.output


@pytest.mark.costly
def test_properties_are_proved_monitored_in_run_and_kept_in_journal(start, installed, tmp_path):
    proof = start("sar-compile", "verify", PATROL, env=installed)
    assert proof.end() == 0, proof.output
    assert "5 outcomes: 5 proved" in proof.output
    flown = ("--properties", "--journal", tmp_path / "m.journal", "--fault", "take_photo:refuse=2")
    run = start("sar-run", PATROL, "--sim", "--speed", 20, *flown, env=installed)
    assert run.end() == 1, run.output
    assert "Monitored 3 properties: none violated." in run.output
    compared = start("sar-compile", "conform", PATROL, tmp_path / "m.journal", env=installed)
    assert compared.end() == 0, compared.output
    assert "3 properties: 3 kept" in compared.output


@pytest.mark.costly
def test_failed_photo_is_retried(start, installed):
    faults = ("--fault", "take_photo:refuse=1", "--fault", "take_photo:delay=1")
    run = start("sar-run", "--mission", "photo_patrol", "--sim", "--speed", 20, *faults, env=installed)
    assert run.end() == 0, run.output
    assert "'TakePhoto' failed: the lens is covered" in run.log
    assert "Patrol: 3 of 3 photos" in run.output


@pytest.mark.costly
def test_missing_camera_service_is_named(start, installed):
    run = start("sar-run", PATROL, "--ros-args", "-p", "startup_timeout_sec:=1.0", env=installed)
    assert run.end() == 3
    assert "service take_photo: no server" in run.output


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--sim", "--fault", "take_photo:refus=1"], "did you mean 'refuse'?"),
        (["--sim", "--fault", "report_survivor:drop=1"], "(known: take_photo, navigate_to_pose, amcl)"),
        (
            ["--ros-args", "-p", "point_order:=[yrd]"],
            "which has no pose: add points.yrd.x, .y and .yaw; did you mean",
        ),
        (
            ["--ros-args", "-p", "point_order:=[yard, yard]", "-p", "tick_rate_hz:=0"],
            "2 errors in the parameters:",
        ),
    ],
)
def test_usage_error_is_reported_before_robot_moves(start, installed, arguments, words):
    run = start("sar-run", PATROL, *arguments, env=installed)
    assert run.end() == 2
    assert words in run.output
    assert "Driving" not in run.output


@pytest.mark.costly
def test_run_of_tree_with_leaves_of_two_missions_is_refused(start, installed, tmp_path):
    tree = tmp_path / "both.xml"
    tree.write_text(document("<Sequence><ZonesRemaining/><TakePhoto/></Sequence>"), encoding="utf-8")
    both = start("sar-run", tree, env=installed)
    assert both.end() == 2
    assert (
        "both.xml:3:28: error[several-missions]: the leaves of this tree belong to several missions"
        in both.output
    )
    one = start("sar-run", tree, "--mission", "photo_patrol", env=installed)
    assert one.end() == 2
    assert (
        "both.xml:3:11: error[missing-context]: <ZonesRemaining> needs an object of the type ZoneManager"
        in one.output
    )


@pytest.mark.costly
def test_leaves_of_two_missions_are_reported_by_checking_commands(start, installed, tmp_path):
    tree = tmp_path / "both.xml"
    tree.write_text(document("<Sequence><ZonesRemaining/><TakePhoto/></Sequence>"), encoding="utf-8")
    found = start("sar-compile", "validate", tree, env=installed)
    assert found.end() == 1
    assert "both.xml:3:28: error[several-missions]" in found.output
    verified = start("sar-compile", "verify", tree, env=installed)
    assert verified.end() == 1
    assert "--mission NAME" in verified.output
    for command in ("validate", "simulate", "verify"):
        named = start("sar-compile", command, tree, "--mission", "photo_patrol", env=installed)
        named.end()
        assert "several-missions" not in named.output
    misspelt = start("sar-compile", "validate", tree, "--mission", "photo_patro", env=installed)
    assert misspelt.end() == 2
    assert "did you mean 'photo_patrol'?" in misspelt.output


@pytest.mark.costly
def test_crashed_patrol_is_resumed_without_second_photo_of_any_point(start, installed, tmp_path):
    patrol = ("--mission", "photo_patrol", "--sim", "--speed", 20, "--journal", tmp_path / "patrol.journal")
    dead = start("python", "-c", KILLER, 5, "written", *patrol, env=installed)
    assert dead.end() == -signal.SIGKILL
    assert "Driving to depot..." in dead.log
    run = start("sar-run", *patrol, "--resume", "--report", tmp_path / "r.json", env=installed)
    assert run.end() == 0, run.output
    assert [line for line in run.log if line.startswith("Driving")] == ["Driving to yard..."]
    assert "Patrol: 3 of 3 photos" in run.output
    data = json.loads((tmp_path / "r.json").read_text(encoding="utf-8"))
    facts = data["facts"]
    assert [each["data"] for each in facts if each["kind"] == "photo_taken"] == [
        {"photo": f"photo_{number}"}
        for number in (1, 2, 1)  # the camera has been restarted, too
    ]
    assert [each["kind"] for each in facts].count("point_left") == 3
    assert [point["level"] for point in data["landmarks"]["points"]] == ["done"] * 3
    assert [(figure["value"], figure["of"]) for figure in data["figures"]] == [(3, 3)]

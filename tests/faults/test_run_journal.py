"""Tests of the journal of `sar-run`: its path, resuming it, and the refusals before the mission starts."""

import json
import signal

import pytest

from tests.trees import document

pytestmark = pytest.mark.ros

# A tree that needs no server and does not end.
WAITING = document('<Sequence name="Wait"><Sleep msec="1000000"/></Sequence>')
MISSION = ("--mission", "search_and_rescue")


@pytest.fixture
def tree(tmp_path):
    path = tmp_path / "tree.xml"
    path.write_text(WAITING, encoding="utf-8")
    return path


@pytest.fixture
def state(tmp_path):
    """Return the environment with the user's state folder."""
    return {"XDG_STATE_HOME": str(tmp_path / "state")}


def journals(tmp_path):
    return sorted(path.name for path in (tmp_path / "state" / "sar_compiler").glob("*.journal"))


@pytest.fixture
def begin(start, tree, state):
    """Return a function that starts a run of the mission and waits for its first tick."""

    def run(*arguments, env=None):
        command = start("sar-run", tree, *MISSION, "--view", "text", *arguments, env={**state, **(env or {})})
        return command.wait_for("Sleep RUNNING")

    return run


def kill_run(run):
    run.send(signal.SIGKILL)
    run.end()


def refused_output(start, tree, state, *arguments):
    run = start("sar-run", tree, *MISSION, *arguments, env=state)
    assert run.end() == 2, run.output
    return run.output


def test_mission_on_robot_has_journal_named_after_node(begin, tmp_path):
    begin("--ros-args", "-r", "__ns:=/robot1", env={"ROS_DOMAIN_ID": "0"}).stop()
    assert journals(tmp_path) == ["robot1.search_and_rescue.journal"]


def test_run_with_journal_none_leaves_no_file(begin, tmp_path):
    begin("--journal", "none").stop()
    assert journals(tmp_path) == []


def test_plain_tree_has_no_journal_by_default(start, tree, state, tmp_path):
    start("sar-run", tree, "--view", "text", env=state).wait_for("Sleep RUNNING").stop()
    assert journals(tmp_path) == []


def test_killed_mission_must_be_resumed_or_started_over(start, begin, tree, state, tmp_path):
    kill_run(begin())
    words = refused_output(start, tree, state)
    assert "is not over: it was started on 20" in words
    assert "--resume" in words
    run = begin("--resume")
    assert " resumes after 0 events." in run.output
    kill_run(run)
    run = begin("--new")
    assert "The previous journal is kept as" in run.output
    run.stop()
    assert len(journals(tmp_path)) == 2


@pytest.mark.costly
def test_stopped_mission_in_default_journal_is_replaced(begin, start, tree, state, tmp_path):
    begin().stop()
    run = begin()
    assert "The previous journal is kept as" in run.output
    run.stop(signal.SIGTERM)
    assert len(journals(tmp_path)) == 2
    named = tmp_path / "named.journal"
    begin("--journal", named).stop()
    assert "it was stopped on 20" in refused_output(start, tree, state, "--journal", named)
    begin("--journal", named, "--resume").stop()


def test_second_run_is_refused_while_first_is_active(begin, start, tree, state):
    run = begin()
    for arguments in ((), ("--resume",), ("--new",)):
        assert "runs in another process" in refused_output(start, tree, state, *arguments)
    run.stop()


def test_journal_of_active_mission_can_be_shown(begin, start, tmp_path):
    place = tmp_path / "mission.journal"
    run = begin("--journal", place)
    show = start("sar-journal", "show", place, "--format", "json")
    assert show.end() == 0
    data = json.loads(show.output)
    run.stop()
    assert data["state"] == "running"
    assert data["mission"] == "search_and_rescue"
    assert [child["name"] for child in data["tree"]["children"]] == ["Sleep"]
    assert data["runs"][0]["about"]["parameters"]["zone_order"] == ["zone_a", "zone_b", "zone_c", "zone_d"]
    assert start("sar-journal", "show", place).end() == 0


def test_resuming_with_changed_parameters_is_refused_by_name(begin, start, tree, state):
    kill_run(begin())
    more = ("--resume", "--ros-args", "-p", "zone_order:=[zone_b]", "-p", "base_station.x:=1.0")
    words = refused_output(start, tree, state, *more)
    assert "2 errors in the parameters" in words
    assert "zones: is [{'id': 'zone_b'" in words
    assert "base_station: is {'x': 1.0" in words


def test_unwritable_journal_path_is_refused_only_if_requested(begin, start, tree, state, tmp_path):
    nowhere = {"XDG_STATE_HOME": "/dev/null"}
    run = begin(env=nowhere)
    assert "No journal is written, so this mission cannot be resumed: the journal /dev/null/" in run.output
    assert run.stop() == 130
    assert "there is no journal /dev/null/" in refused_output(start, tree, nowhere, "--resume")
    assert "cannot be used: " in refused_output(start, tree, nowhere, "--new")
    assert "cannot be used: " in refused_output(start, tree, state, "--journal", "/dev/null/mission.journal")
    assert "Is a directory" in refused_output(start, tree, state, "--journal", tmp_path)


def test_check_does_not_change_journals(begin, start, tree, state, tmp_path):
    kill_run(begin())
    before = [path.read_bytes() for path in sorted((tmp_path / "state" / "sar_compiler").iterdir())]
    assert start("sar-run", tree, *MISSION, "--check", env=state).end() == 0
    assert [path.read_bytes() for path in sorted((tmp_path / "state" / "sar_compiler").iterdir())] == before


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--resume", "--new"], "not allowed with"),
        (["--check", "--resume"], "--check does not run the mission"),
        (["--journal", "none", "--resume"], "--resume and --new require a journal"),
        (["--resume"], " to resume. Omit --resume"),
    ],
)
def test_contradictory_options_are_refused(start, tree, state, arguments, words):
    assert words in refused_output(start, tree, state, *arguments)


def test_leaf_can_use_journal_of_its_run(start, tmp_path):
    (tmp_path / "diary.py").write_text(
        "from py_trees.behaviour import Behaviour\n"
        "from py_trees.common import Status\n"
        "from sar_compiler.leaves import Kind, register\n"
        "from sar_compiler.missions import Journal\n"
        "@register('Write', kind=Kind.ACTION)\n"
        "class Write(Behaviour):\n"
        "    def __init__(self, name: str, journal: Journal | None = None) -> None:\n"
        "        super().__init__(name)\n"
        "        self.journal = journal\n"
        "    def update(self):\n"
        "        if self.journal is not None:\n"
        "            self.journal.record_event('written', by=self.name)\n"
        "        return Status.SUCCESS\n",
        encoding="utf-8",
    )
    tree, place = tmp_path / "tree.xml", tmp_path / "mission.journal"
    tree.write_text(document('<Write name="me"/>'), encoding="utf-8")
    env = {"PYTHONPATH": str(tmp_path)}
    assert start("sar-run", tree, "--nodes", "diary", env=env).end() == 0
    assert start("sar-run", tree, "--nodes", "diary", "--journal", place, env=env).end() == 0
    show = start("sar-journal", "show", place, "--all")
    assert show.end() == 0
    assert "written  by me" in " ".join(show.output.split()).replace("written by", "written  by")
    assert "node 'me', tick 1, status SUCCESS" in show.output
    assert show.output.startswith("a tree without a mission, complete: ")

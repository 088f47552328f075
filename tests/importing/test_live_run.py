"""Tests of following runs of other programs live."""

import signal
from contextlib import closing

import pytest
from py_trees.trees import BehaviourTree

import sar_compiler
from sar_compiler import Groot2Publisher
from sar_compiler.importing.live_run import Groot2Source, LiveRun, TopicSource
from sar_compiler.importing.recording import UnusableRecordingError
from sar_compiler.journal.database import JournalFile
from sar_compiler.journal.journal_entries import RUN_BEGAN, RUN_ENDED, STATUS
from sar_compiler.leaves import Clock
from sar_compiler.project import Workspace
from sar_compiler.testing import ManualClock
from tests.groot2.test_groot2 import Queue, main
from tests.importing.test_import import FAILED, NAV2, bag_messages, import_log, nav2_messages
from tests.processes import Command, free_port
from tests.trees import write


class Publisher:
    """Publishes the messages of a recorded run."""

    def __init__(self):
        self.waiting = []
        self.source = TopicSource(self.messages)

    def messages(self):
        waiting, self.waiting = self.waiting, []
        return waiting


def follow_run(messages, tree, journal=None):
    """Return the entries of a run whose messages arrive one by one."""
    publisher = Publisher()
    run = LiveRun(publisher.source, "log", Workspace(), [tree], journal=journal)
    entries = []
    for message in messages:
        publisher.waiting.append(message)
        entries += run.read_new()
    run.close()
    return entries


@pytest.fixture
def tree(tmp_path):
    import_log(FAILED, tmp_path)
    return tmp_path / "delivery_failed.journal.xml"


def test_followed_topic_has_entries_of_its_bag(tree):
    entries = follow_run(bag_messages(FAILED), tree)
    with JournalFile.open_snapshot(tree.with_suffix("")) as file:
        statuses = [each.data for each in file.observations(STATUS)]
    assert entries[0].kind == RUN_BEGAN
    assert [each.data for each in entries[1:] if each.kind == STATUS] == statuses
    assert entries[-1].data["reason"] == "the tree returned FAILURE"


def test_followed_topic_is_recorded_like_its_bag(tree, tmp_path):
    entries = follow_run(bag_messages(FAILED), tree, tmp_path / "kept.journal")
    with JournalFile.open_snapshot(tmp_path / "kept.journal") as file:
        kept = [(each.kind, each.data) for each in file.last_run() if each.kind in (STATUS, RUN_ENDED)]
    assert kept[:-1] == [(each.kind, each.data) for each in entries if each.kind == STATUS]
    assert kept[-1][0] == RUN_ENDED
    assert kept[-1][1]["reason"] == "the tree returned FAILURE"


def test_run_followed_only_in_part_is_stopped_in_journal(tree, tmp_path):
    first, *_ = bag_messages(FAILED)
    follow_run([first], tree, tmp_path / "kept.journal")
    with JournalFile.open_snapshot(tmp_path / "kept.journal") as file:
        [ended] = [each.data for each in file.last_run() if each.kind == RUN_ENDED]
    assert (ended["ending"], ended["reason"]) == ("stopped", "the recording was stopped")


def test_ancestors_of_running_node_run_if_log_begins_in_middle(tree):
    _, *later = bag_messages(FAILED)
    began, *entries = follow_run(later, tree)
    shown: dict[int, str] = {}
    for each in entries[:-1]:
        shown.setdefault(each.data["node"], each.data["status"])
    assert began.kind == RUN_BEGAN
    assert shown[0] == "RUNNING"


def test_different_tree_is_rejected_at_first_differing_name(tree):
    text = tree.read_text(encoding="utf-8").replace("grasp the box", "take the box")
    tree.write_text(text, encoding="utf-8")
    with pytest.raises(UnusableRecordingError, match="node 10 is 'grasp the box' in the run"):
        follow_run(bag_messages(FAILED), tree)


def statuses(entries):
    return [(each.data["node"], each.data["status"]) for each in entries if each.kind == STATUS]


def test_groot2_publisher_is_followed_from_its_current_statuses(tmp_path):
    path = tmp_path / "tree.xml"
    write(
        path,
        *main('<Sequence name="s"><Queue name="a" answers="RSS"/><Queue name="b" answers="RF"/></Sequence>'),
        main="Main",
    )
    compiled = sar_compiler.load(path, nodes=[Queue]).compile(context={Clock: ManualClock()})
    ticking, port = BehaviourTree(compiled.root), free_port()
    publisher = Groot2Publisher(compiled, port)
    with closing(publisher):
        publisher.observe(ticking)
        ticking.tick()
        with closing(Groot2Source(f"127.0.0.1:{port}")) as source:
            run = LiveRun(source, "robot", Workspace())
            begun = run.read_new()
            ticking.tick()
            later = run.read_new()
            ticking.tick()
            later += run.read_new()
            publisher.close()
            ended = run.read_new()
            after = run.read_new()
            run.close()
    assert begun[0].kind == RUN_BEGAN
    assert statuses(begun) == [(0, "RUNNING"), (1, "RUNNING")]
    assert statuses(later) == [(1, "SUCCESS"), (2, "RUNNING"), (2, "FAILURE"), (0, "FAILURE")]
    assert [each.kind for each in ended] == [RUN_ENDED]
    assert (ended[0].data["ending"], after) == ("over", [])


def test_missing_program_is_reported_with_publisher_class():
    with pytest.raises(UnusableRecordingError, match=r"no program responds at .*Groot2Publisher"):
        Groot2Source(f"127.0.0.1:{free_port()}")


def test_address_without_port_is_rejected():
    with pytest.raises(UnusableRecordingError, match="robot is not HOST:PORT"):
        Groot2Source("robot")


def test_nav2_goal_ends_as_soon_as_nav2_has_logged_its_end(tmp_path):
    messages, lines = nav2_messages()
    failed = next(each for each in lines if b"Goal failed" in each)
    known, _ = (NAV2 / "goals.txt").read_text(encoding="utf-8").split("Goal failed", 1)
    published = known.count("message ")
    queues: dict[str, list[bytes]] = {"messages": [], "lines": []}

    def take_queue(name):
        found, queues[name] = queues[name], []
        return found

    source = TopicSource(lambda: take_queue("messages"), lambda: take_queue("lines"))
    run = LiveRun(source, "log", Workspace(), [NAV2 / "goals.xml"], journal=tmp_path / "kept.journal")

    def ends():
        return [each.data["reason"] for each in run.read_new() if each.kind == RUN_ENDED]

    queues["messages"] = messages[:published]
    assert ends() == ["the tree returned SUCCESS"]
    queues["lines"] = lines[: lines.index(failed) + 1]
    [reported] = ends()
    assert reported.startswith("Nav2 has reported 'Goal failed'. planner_server: ")
    assert ends() == []
    queues["messages"] = messages[published:]
    assert ends() == ["the tree returned FAILURE", "the program has halted the tree"]
    run.close()
    with JournalFile.open_snapshot(tmp_path / "kept.journal") as file:
        assert [each.reason for each in file.runs()][1] == "the tree returned FAILURE"


def test_watched_run_is_ended_in_journal_if_command_is_terminated(tmp_path):
    path = tmp_path / "tree.xml"
    write(path, *main('<Queue name="a" answers="RRRR"/>'), main="Main")
    compiled = sar_compiler.load(path, nodes=[Queue]).compile(context={Clock: ManualClock()})
    ticking, port = BehaviourTree(compiled.root), free_port()
    publisher, journal = Groot2Publisher(compiled, port), tmp_path / "kept.journal"
    with closing(publisher):
        publisher.observe(ticking)
        ticking.tick()
        address = f"127.0.0.1:{port}"
        command = Command("sar-journal", "watch", "--groot2", address, "--journal", journal, "--web-port", 0)
        command.wait_for("Page:")
        command.wait_until(lambda: journal_runs(journal), "the run in the journal")
        assert command.stop(signal.SIGTERM) == 0, command.output
    assert [(each.ending, each.reason) for each in journal_runs(journal)] == [
        ("stopped", "the recording was stopped")
    ]


def journal_runs(path):
    with JournalFile.open_snapshot(path) as file:
        return file.runs()

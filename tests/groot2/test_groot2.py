"""Tests of the Groot2 publisher, with a client of its protocol."""

import itertools
import json
import os
import select
import subprocess
import sys
import threading
import time
from contextlib import ExitStack, closing
from xml.etree import ElementTree as ET

import pytest
import zmq
from py_trees.behaviours import StatusQueue
from py_trees.common import Status
from py_trees.trees import BehaviourTree

import sar_compiler
from sar_compiler import Groot2Publisher, SarError
from sar_compiler.groot2 import groot2_publisher
from sar_compiler.groot2.groot2_publisher import snapshot
from sar_compiler.leaves import Clock, Kind, register
from sar_compiler.nodes.registry import default_registry
from sar_compiler.runtime.blackboard import Entry
from sar_compiler.testing import ManualClock
from tests.groot2.groot2_client import Client, request
from tests.processes import free_port, listening_addresses
from tests.trees import write
from tests.waiting import SILENCE_SEC

IDLE, RUNNING, SUCCESS, FAILURE = range(4)
WAS = 10


@register("Queue", kind=Kind.ACTION, outcomes={Status.SUCCESS, Status.FAILURE, Status.RUNNING})
class Queue(StatusQueue):
    """Returns one status a tick, S, F or R, and repeats the last one."""

    def __init__(self, name: str, answers: str) -> None:
        statuses = [{"S": Status.SUCCESS, "F": Status.FAILURE, "R": Status.RUNNING}[each] for each in answers]
        super().__init__(name, statuses, eventually=statuses[-1])


@pytest.fixture
def stage(tmp_path):
    """Return a function that publishes a tree and returns a ticker and a client."""
    with ExitStack() as stack:

        def show(*content, parameters=None, **options):
            path = tmp_path / "tree.xml"
            write(path, *content, main="Main")
            loaded = sar_compiler.load(path, nodes=[Queue])
            tree = loaded.compile(parameters=parameters or {}, context={Clock: ManualClock()})
            port = free_port()
            publisher = stack.enter_context(closing(Groot2Publisher(tree, port, **options)))
            ticking = BehaviourTree(tree.root)
            publisher.observe(ticking)
            return ticking, stack.enter_context(closing(Client(port)))

        yield show


def main(*body):
    return ('<BehaviorTree ID="Main">', *body, "</BehaviorTree>")


def test_tree_has_block_for_each_subtree_use_and_preorder_numbers(stage):
    _, client = stage(
        *main('<Sequence name="s"><SubTree ID="In" name="one" x="{a}"/><SubTree ID="In"/></Sequence>'),
        '<BehaviorTree ID="In"><Sequence><AlwaysSuccess/></Sequence></BehaviorTree>',
    )
    (xml,) = client.ask("T")
    root = ET.fromstring(xml)  # noqa: S314 - it is ours
    assert [(each.get("ID"), each.get("_fullpath")) for each in root.iter("BehaviorTree")] == [
        ("Main", ""),
        ("In", "one"),
        ("In", "In::5"),
    ]
    assert [dict(each.attrib) for each in root.iter("SubTree")] == [
        {"ID": "In", "x": "{a}", "_fullpath": "one", "_uid": "2"},
        {"ID": "In", "_fullpath": "In::5", "_uid": "5"},
    ]
    assert [int(each.get("_uid", 0)) for each in root.iter() if each.get("_uid")] == [1, 2, 5, 3, 4, 6, 7]


def test_nodes_have_btcpp_names_and_attributes(stage):
    _, client = stage(
        *main(
            '<Selector memory="false" name="look &lt;again&gt;"><Queue answers="S" oneshot="ON_COMPLETION"/>'
            '<Retry num_failures="2"><AlwaysFailure _onFailure="n := 2"/></Retry></Selector>'
        ),
        parameters={"n": 1},
    )
    root = ET.fromstring(client.ask("T")[0])  # noqa: S314 - it is ours
    written = {each.tag: dict(each.attrib) for each in root.iter() if each.get("_uid")}
    assert written == {
        "ReactiveFallback": {"name": "look <again>", "_uid": "1"},
        "RunOnce": {"name": "QueueOneShot", "then_skip": "false", "_uid": "2"},
        "Queue": {"name": "Queue", "answers": "S", "_uid": "3"},
        "RetryUntilSuccessful": {"name": "Retry", "num_attempts": "2", "_uid": "4"},
        "AlwaysFailure": {"name": "AlwaysFailure", "_onFailure": "n := 2", "_uid": "5"},
    }
    (model,) = next(root.iter("TreeNodesModel"))
    assert (model.tag, model.get("ID"), [port.get("name") for port in model]) == (
        "Action",
        "Queue",
        ["answers"],
    )


def test_publishing_needs_no_default_registry(stage):
    default_registry.cache_clear()
    _, client = stage(
        *main('<Selector memory="false"><Queue answers="S" oneshot="ON_COMPLETION"/></Selector>')
    )
    assert b"<RunOnce" in client.ask("T")[0]
    assert default_registry.cache_info().misses == 0


def test_oneshot_subtree_is_published_with_run_once_node(stage):
    _, client = stage(
        *main('<SubTree ID="In" name="one" oneshot="ON_COMPLETION" x="1"/>'),
        '<BehaviorTree ID="In"><AlwaysSuccess/></BehaviorTree>',
    )
    root = ET.fromstring(client.ask("T")[0])  # noqa: S314 - it is ours
    (once,) = root.iter("RunOnce")
    assert [dict(each.attrib) for each in once] == [{"ID": "In", "x": "1", "_fullpath": "one", "_uid": "2"}]


def test_tick_does_not_wait_for_snapshot(stage, monkeypatch):
    tree, client = stage(*main('<Queue answers="R"/>'))
    was_ticked = []

    def make(shown):
        ticking = threading.Thread(target=tree.tick)
        ticking.start()
        ticking.join(10.0)
        was_ticked.append(not ticking.is_alive())
        return snapshot(shown)

    monkeypatch.setattr(groot2_publisher, "snapshot", make)
    assert client.statuses() == {1: IDLE}
    assert was_ticked == [True]


def test_finished_node_is_idle_after_its_parent_has_finished(stage):
    tree, client = stage(*main('<Sequence><Queue answers="S"/><Queue answers="RSR"/></Sequence>'))
    assert client.statuses() == {1: IDLE, 2: IDLE, 3: IDLE}
    tree.tick()
    assert client.statuses() == {1: RUNNING, 2: SUCCESS, 3: RUNNING}
    tree.tick()
    assert client.statuses() == dict.fromkeys((1, 2, 3), WAS + SUCCESS)
    tree.tick()
    assert client.statuses() == {1: RUNNING, 2: SUCCESS, 3: RUNNING}


def test_halted_node_is_published_as_was_running(stage):
    tree, client = stage(
        *main('<ReactiveSequence><Queue answers="SF"/><Queue answers="R"/></ReactiveSequence>')
    )
    tree.tick()
    tree.tick()
    assert client.statuses() == {1: WAS + FAILURE, 2: WAS + FAILURE, 3: WAS + RUNNING}


def test_skipped_node_is_unchanged_and_shares_number_with_its_conditions(stage):
    tree, client = stage(
        *main(
            '<Sequence><Queue answers="S" _skipIf="n == 1"/><Queue answers="R" _onSuccess="n := 2"/></Sequence>'
        ),
        parameters={"n": 1},
    )
    tree.tick()
    assert client.statuses() == {1: RUNNING, 2: IDLE, 3: RUNNING}


def test_recording_has_changes_in_order_and_is_read_once(stage):
    tree, client = stage(*main('<Sequence><Queue answers="S"/><Queue answers="RS"/></Sequence>'))
    tree.tick()
    assert client.transitions() == []
    before = time.time_ns() // 1000
    (began,) = client.ask("r", b"start")
    assert before <= int(began) <= time.time_ns() // 1000
    tree.tick()
    read = client.transitions()
    assert [change[1:] for change in read] == [(3, SUCCESS), (1, SUCCESS), (1, IDLE), (2, IDLE), (3, IDLE)]
    times = [change[0] for change in read]
    assert times == sorted(times)
    assert client.transitions() == []
    assert client.ask("r", b"stop") == []
    tree.tick()
    assert client.transitions() == []


def test_recording_keeps_last_thousand_changes(stage):
    tree, client = stage(*main('<Sequence><Queue answers="S"/></Sequence>'))
    client.ask("r", b"start")
    for _ in range(300):
        tree.tick()
    assert len(client.transitions()) == 1000


def test_blackboards_are_named_by_tree_id_and_subtree_path(stage):
    tree, client = stage(
        *main(
            '<Sequence><Script code="a := 2"/><SubTree ID="In" name="one" x="{a}"/></Sequence>',
        ),
        '<BehaviorTree ID="In"><Script code="b := x + 1; @c := \'text\'"/></BehaviorTree>',
        parameters={"p": [1.5, 2.5]},
    )
    tree.tick()
    of_main = {"a": 2, "c": "text", "p": [1.5, 2.5]}
    assert client.blackboards("Main") == {"Main": of_main}
    assert client.blackboards("one;nothing") == {"one": {"b": 3, "x": 2}, "ROOT": of_main}
    assert client.blackboards("nothing") is None
    # A viewer that names no blackboard receives null, as from BehaviorTree.CPP.
    assert client.blackboards("") is None


def test_unserializable_value_is_published_as_null(stage):
    _, client = stage(*main('<Queue answers="S"/>'), parameters={"p": object(), "big": 2**70})
    assert client.blackboards("Main") == {"Main": {"p": None, "big": None}}


def test_entry_removed_during_request_is_omitted(stage, monkeypatch):
    tree, client = stage(
        *main('<Sequence><Script code="a := 2"/><SubTree ID="In" name="one" x="{never}"/></Sequence>'),
        '<BehaviorTree ID="In"><AlwaysSuccess/></BehaviorTree>',
    )
    tree.tick()
    # As if the entry had existed just before.
    monkeypatch.setattr(Entry, "exists", property(lambda _: True))
    assert client.blackboards("one") == {"one": {}, "ROOT": {"a": 2}}


def test_value_changed_during_request_is_published_unchanged(stage):
    changing: dict[str, object] = {"n": 1}

    class Changes(dict[str, int]):
        def items(self):
            changing["odd"] = object()
            return super().items()

    _, client = stage(*main('<Queue answers="S"/>'), parameters={"a": changing, "b": Changes(m=2)})
    assert client.blackboards("Main") == {"Main": {"a": {"n": 1}, "b": {"m": 2}}}


@pytest.mark.parametrize(
    ("frames", "words"),
    [
        ([b""], "the header of this request has a wrong length"),
        ([b"abc"], "the header of this request has a wrong length"),
        ([request("T") + b"x"], "the header of this request has a wrong length"),
        ([request("?")], "this kind of request is unknown"),
        ([request("N")], "this kind of request is unknown"),
        ([request("B")], "this request must have exactly 2 parts"),
        ([request("B"), b"a", b"b"], "this request must have exactly 2 parts"),
        ([request("B"), b"\xff\xfe"], "the second part of the request is not valid UTF-8"),
        ([request("r")], "this request must have exactly 2 parts"),
        ([request("I"), b"{}"], "breakpoints and substituted outcomes are not supported"),
    ],
)
def test_malformed_request_is_rejected_and_next_one_is_served(frames, words, stage):
    tree, client = stage(*main('<Queue answers="R"/>'))
    assert words in client.refused(*frames)
    tree.tick()
    assert client.statuses() == {1: RUNNING}


def test_oversized_request_closes_only_its_connection(stage):
    _, client = stage(*main("<AlwaysSuccess/>"))
    client.is_disconnected_by(request("T"), bytes(2**20 + 1))
    assert client.ask("T")


@pytest.mark.parametrize("part", [None, b"", b"{}", b"a", b'[{"uid": 1, "result": "SUCCESS"}]'])
def test_no_request_changes_tree(stage, part):
    tree, client = stage(*main('<Queue answers="RS"/>'), parameters={"a": 1})
    tree.tick()
    before = client.statuses(), client.blackboards("Main")
    for kind in map(chr, range(256)):
        if kind not in "rt":  # these start the recording, and read it
            client.send(request(kind), *([] if part is None else [part]))
    assert (client.statuses(), client.blackboards("Main")) == before
    tree.tick()
    assert tree.root.status is Status.SUCCESS


def test_publisher_listens_on_loopback_only(tmp_path):
    write(tmp_path / "tree.xml", *main("<AlwaysSuccess/>"), main="Main")
    tree, port = sar_compiler.load(tmp_path / "tree.xml").compile(), free_port()
    with closing(Groot2Publisher(tree, port)):
        assert listening_addresses(port) == listening_addresses(port + 1) == {"127.0.0.1"}


def test_list_of_breakpoints_is_empty(stage):
    _, client = stage(*main('<Queue answers="R"/>'))
    assert (client.ask("D"), client.ask("A"), client.ask("X")) == ([b"[]"], [], [])


def test_port_in_use_is_reported(tmp_path):
    write(tmp_path / "tree.xml", *main("<AlwaysSuccess/>"), main="Main")
    tree = sar_compiler.load(tmp_path / "tree.xml").compile()
    port = free_port()
    with closing(Groot2Publisher(tree, port)):
        with pytest.raises(SarError, match=f"port {port} of 127.0.0.1 cannot be used"):
            Groot2Publisher(tree, port)
        with pytest.raises(SarError, match=f"port {port} of 127.0.0.1 cannot be used"):
            Groot2Publisher(tree, port - 1)
    Groot2Publisher(tree, port).close()


@pytest.mark.parametrize("port", [-1, 0, 65535, 70000])
def test_invalid_port_is_reported(port, tmp_path):
    write(tmp_path / "tree.xml", *main("<AlwaysSuccess/>"), main="Main")
    with pytest.raises(SarError, match="there is no port"):
        Groot2Publisher(sar_compiler.load(tmp_path / "tree.xml").compile(), port)


def test_tree_with_too_many_nodes_is_rejected(tmp_path):
    few = "<AlwaysSuccess/>" * 255
    write(
        tmp_path / "tree.xml",
        *main("<Sequence>", *[f'<SubTree ID="In" name="{number}"/>' for number in range(256)], "</Sequence>"),
        f'<BehaviorTree ID="In"><Sequence>{few}</Sequence></BehaviorTree>',
        main="Main",
    )
    tree = sar_compiler.load(tmp_path / "tree.xml").compile()
    with pytest.raises(SarError, match=r"'Main' has 65793 nodes\. .* allow at most 65535,"):
        Groot2Publisher(tree, free_port())


def port_of(client):
    return client._asking.getsockopt_string(zmq.LAST_ENDPOINT).rpartition(":")[2]


@pytest.fixture
def btview(stage):
    """Return a command of btview, an independent client, for a tree with a running node."""
    pytest.importorskip("btview", reason="btview, from PyPI, is not installed")
    tree, client = stage(
        *main('<Sequence name="Work"><Queue answers="S"/><SubTree ID="In" name="one"/></Sequence>'),
        '<BehaviorTree ID="In"><Queue name="Waiting" answers="R"/></BehaviorTree>',
    )
    tree.tick()

    def command(name, *arguments):
        return [sys.executable, "-m", "btview", name, "--port", port_of(client), *arguments]

    return command


def test_btview_shows_tree(btview):
    words = btview("snapshot", "--ascii", "--no-color")
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    lines = [line.split() for line in done.stdout.splitlines()]
    for name, status in (
        ("Work", "RUNNING"),
        ("Queue", "SUCCESS"),
        ("SubTree", "RUNNING"),
        ("Waiting", "RUNNING"),
    ):
        assert any(name in line and line[-1] == status for line in lines), lines


def test_btview_prints_status_changes(stage):
    tree, client = stage(*main('<Queue name="Swinging" answers="S"/>'))
    answers = itertools.cycle([*[Status.RUNNING] * 20, *[Status.SUCCESS] * 20])
    words = [sys.executable, "-u", "-m", "btview", "echo", "--json", "--port", port_of(client)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as echo:
        assert echo.stdout is not None
        try:
            deadline = time.monotonic() + SILENCE_SEC
            while not select.select([echo.stdout], [], [], 0.01)[0]:
                assert time.monotonic() < deadline
                tree.root.current_queue = [next(answers)]
                tree.tick()
            line = json.loads(echo.stdout.readline())
        finally:
            echo.kill()
    assert (line["uid"], line["node"]) == (1, "Swinging [Queue]")
    assert {line["from"], line["to"]} <= {"IDLE", "RUNNING"}


def test_btview_records_tree(btview, tmp_path):
    pipe = tmp_path / "run.jsonl"
    os.mkfifo(pipe)
    # Opened for writing as well, so that it never reports an end of file.
    with (
        pipe.open("r+b", buffering=0) as recorded,
        subprocess.Popen(btview("record", "--output", str(pipe)), stdout=subprocess.DEVNULL) as recorder,
    ):
        try:
            text = b""
            while text.count(b"\n") < 2:
                assert select.select([recorded], [], [], SILENCE_SEC)[0], "btview records nothing more"
                text += recorded.read(65536)
        finally:
            recorder.kill()
    head, first = map(json.loads, text.splitlines()[:2])
    assert 'name="Waiting"' in head["tree_xml"]
    assert first["s"] == [[1, RUNNING], [2, SUCCESS], [3, RUNNING], [4, RUNNING]]

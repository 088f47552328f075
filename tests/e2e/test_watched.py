"""`sar-run` as others watch it."""

import json
from contextlib import closing

import pytest

from tests.cli.test_what_is_not_installed import run_without
from tests.monitoring.groot2_client import Client, free_port
from tests.trees import document

pytestmark = pytest.mark.ros

# It needs no server, and goes on for ever.
WAITING = document('<Sequence name="Wait"><Sleep msec="1000000"/></Sequence>')
IDLE, RUNNING = 0, 1


@pytest.fixture
def tree(tmp_path):
    path = tmp_path / "tree.xml"
    path.write_text(WAITING, encoding="utf-8")
    return path


def test_groot2_sees_a_mission_and_may_hold_it_only_if_allowed(start, tree):
    port = free_port()
    run = start("sar-run", tree, "--view", "text", "--groot2", port).wait_for("--> Sleep [*]")
    with closing(Client(port)) as client:
        assert client.statuses() == {1: RUNNING, 2: RUNNING}
        assert client.ask("D") == [b"[]"]
    run.stop()
    run = start("sar-run", tree, "--view", "text", "--groot2", port, "--groot2-hooks").wait_for(
        "--> Sleep [*]"
    )
    with closing(Client(port)) as client:
        hook = {
            "enabled": True,
            "uid": 2,
            "mode": 0,
            "once": False,
            "desired_status": "SKIPPED",
            "position": 0,
        }
        client.ask("I", json.dumps(hook).encode())
        assert client.heard() == ("N", "2")
        run.wait_for("Groot2 holds the tree before 'Sleep'")
        # It ends as ever.
        run.stop()


def test_a_port_that_is_taken_ends_the_run_before_it_begins(start, tree):
    port = free_port()
    start("sar-run", tree, "--view", "text", "--groot2", port).wait_for("--> Sleep [*]")
    second = start("sar-run", tree, "--groot2", port)
    assert second.end() == 2
    assert f"sar-run: --groot2: port {port} of 127.0.0.1 cannot be used" in second.output


@pytest.mark.parametrize("library", ["zmq", "msgpack"])
def test_without_its_extra_groot2_names_it(library, tree):
    status, said = run_without(library, "cli.run:main", str(tree), "--groot2", "1667")
    assert (status, "Traceback" in said) == (2, False), said
    assert "sar-run: --groot2 needs pyzmq and msgpack" in said
    assert "pip install 'sar_compiler[groot2]'" in said


def test_hooks_without_groot2_are_a_mistake(tree):
    status, said = run_without("zmq", "cli.run:main", str(tree), "--groot2-hooks")
    assert status == 2
    assert "--groot2-hooks is about what Groot2 may do: add --groot2 PORT" in said

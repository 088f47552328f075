"""Tests of the results and messages that `sar-run --serve` sends to its clients, and of the payloads it accepts."""

import os
import re
import signal
from pathlib import Path
from queue import Queue
from threading import Event
from typing import Any

import py_trees
import pytest
from py_trees.common import Status

from sar_compiler.compiler import bind_main
from sar_compiler.execution.command_client import CommandClient
from sar_compiler.execution.serve import ServedProcess, holder, run_result
from sar_compiler.execution.served_runs import EndedRun, PayloadError, parameters_of
from sar_compiler.helper_process import helper_command
from sar_compiler.leaves import Kind, register
from sar_compiler.missions.mission import OperatorCommand
from sar_compiler.missions.mission_choice import find_mission
from sar_compiler.missions.mission_start import fixed_parameters, path_parameters
from sar_compiler.missions.parameter_reader import RUN_PARAMETER_NAMES
from sar_compiler.nodes.registry import Registry, default_registry
from sar_compiler.nodes.spec import MARK
from sar_compiler.project import Workspace
from tests.ros.conftest import make_ros, ros
from tests.trees import document

__all__ = ["make_ros", "ros"]

PAUSE, RESUME = True, False
STOPPED = "the run was stopped before it was complete"


@pytest.mark.parametrize(
    ("status", "last", "ended"),
    [
        (0, '{"status": 0, "reason": ""}', EndedRun("SUCCESS", '{"status": 0, "reason": ""}')),
        (1, '{"status": 1, "reason": "a place was given up"}', EndedRun("FAILURE", "a place was given up")),
        (4, '{"status": 4, "reason": "a goal may be active"}', EndedRun("IDLE", "a goal may be active")),
        (130, '{"status": 130, "reason": ""}', EndedRun("IDLE", "the run was stopped")),
        (2, "", EndedRun("IDLE", "line 3: unknown-node")),
        (3, "waiting for Nav2", EndedRun("IDLE", "line 3: unknown-node")),
        (143, "waiting for Nav2", EndedRun("IDLE", STOPPED)),
        # Killed while writing its summary.
        (-9, '{"status": 0, "rea', EndedRun("IDLE", STOPPED)),
    ],
)
def test_run_result_follows_exit_status_and_summary(status, last, ended):
    assert run_result(status, last, "line 3: unknown-node") == ended


def test_message_puts_verdict_first_and_drops_ros_log_lines():
    log = "[WARN] [1795868746.7] [rcl]: ROS_LOCALHOST_ONLY is deprecated"
    finding, verdict = "tree.xml:3:5: error[unknown-node]: there is no node 'X'", "sar-run: it cannot be run"
    assert run_result(2, "", f"{log}\n{finding}\n{verdict}").message == f"{verdict}\n{finding}"
    assert run_result(3, "", log).message == log


def test_run_ends_even_if_child_process_keeps_output_open(tmp_path, monkeypatch):
    ended: Queue[Any] = Queue()
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "endless.py").write_text(
        "import subprocess, sys\nprint(subprocess.Popen(['sleep', '600']).pid, flush=True)\nsys.exit('no leaves')\n"
    )
    told: Queue[str] = Queue()
    ServedProcess(
        helper_command("sar_compiler.cli.console", "sar_run", "--nodes", "endless"),
        told.put,
        lambda status, end: ended.put((status, end)),
        lambda *_: None,
    )
    status, end = ended.get(timeout=60.0)
    os.kill(int(told.get(timeout=5.0)), signal.SIGKILL)
    assert (status, end.outcome) == (2, "IDLE")


def test_nested_payload_becomes_dotted_parameters():
    assert parameters_of('{"a": {"b": {"c": [1, 2]}, "d": "x"}, "e": true}') == {
        "a.b.c": [1, 2],
        "a.d": "x",
        "e": True,
    }


def test_only_mixed_number_lists_become_floats():
    found = parameters_of('{"a": [1, 2.5], "b": [1, 2], "c": [1, true], "d": ["x", 1.5], "e": []}')
    assert str(found["a"]) == "[1.0, 2.5]"
    assert str([found[name] for name in "bcde"]) == "[[1, 2], [1, True], ['x', 1.5], []]"
    with pytest.raises(PayloadError, match="too large"):
        parameters_of(f'{{"a": [0.5, {10**400}]}}')


def test_documented_payloads_have_parameters_of_the_mission():
    shown = re.findall(
        r"a JSON object: `({.*?})`. If",
        Path("docs/how-to/serve-missions.md").read_text(encoding="utf-8"),
    )
    with pytest.raises(PayloadError) as refused:
        parameters_of("[1]")
    shown += re.findall("such as ({.*})", str(refused.value))
    read = {
        name.partition(".")[0]
        for name in (*RUN_PARAMETER_NAMES, *find_mission("search_and_rescue").parameter_names)
    }
    assert [len(parameters_of(payload)) for payload in shown] == [3, 1]
    assert {name.partition(".")[0] for payload in shown for name in parameters_of(payload)} <= read


@pytest.mark.parametrize("payload", ["", "  \n", "{}"])
def test_empty_payload_has_no_parameters(payload):
    assert parameters_of(payload) == {}


@pytest.mark.parametrize(
    ("payload", "said"),
    [
        ("a: 3", "the payload is not JSON"),
        ("[" * 100_000, "the payload is not JSON"),
        ("[1]", "the payload must be a JSON object"),
        ('{"a": ' * 900 + "1" + "}" * 900, "the payload is nested too deeply"),
        ('{"a": NaN}', "the payload is not JSON: NaN is not a JSON number"),
        ('{"a": {"b": [Infinity]}}', "the payload is not JSON: Infinity is not a JSON number"),
        (
            '{"a\\u0000b": 1}',
            r"the payload has an invalid parameter name 'a\\x00b'. Use only letters, digits and _ in names",
        ),
        ('{"a\\ud800": 1}', "the payload has an invalid parameter name "),
        ('{"search_and_rescue:areas_file": "/etc/passwd"}', "the payload has an invalid parameter name "),
        ('{"/**": {"areas_file": "/etc/passwd"}}', r"the payload has an invalid parameter name '/\*\*'"),
        ('{"a b": 1}', "the payload has an invalid parameter name 'a b'"),
        ('{"": 1}', "the payload has an invalid parameter name ''"),
        ('{"a": {"-p": 1}}', "the payload has an invalid parameter name '-p'"),
    ],
)
def test_invalid_payload_is_rejected(payload, said):
    with pytest.raises(PayloadError, match=said):
        parameters_of(payload)


@register("Photographer", kind=Kind.ACTION, outcomes=[Status.SUCCESS])
class Photographer(py_trees.behaviour.Behaviour):
    """A leaf with a path port."""

    def __init__(self, name: str, folder: Path, note: str) -> None:
        super().__init__(name)


def test_path_parameters_come_from_mission_and_leaf_ports(tmp_path):
    (tmp_path / "tree.xml").write_text(
        document('<Sequence><Photographer folder="{@photos}" note="{@note}"/><ZonesRemaining/></Sequence>'),
        encoding="utf-8",
    )
    registry = Registry([*default_registry().specs(), getattr(Photographer, MARK)])
    tree = Workspace().load(tmp_path / "tree.xml")
    binding = bind_main(tree.forest, registry)
    assert path_parameters(None, binding) == {"photos"}
    assert path_parameters(find_mission("search_and_rescue"), binding) == {"photos", "areas_file"}
    assert "photos" in fixed_parameters(None, binding)


@pytest.mark.ros
class TestPauseCommand:
    @pytest.fixture
    def set_paused(self, ros):
        verbs = (OperatorCommand("pause", "Pause", "It stands.", role="hold"),)
        return holder(CommandClient(ros.node("server"), verbs, of="/mission"), {"hold": "pause"}, "/server")

    def test_new_run_is_paused_once_its_service_exists(self, ros, set_paused):
        from std_srvs.srv import Trigger

        given: list[str] = []
        refused: list[str] = []
        looked = Event()

        def is_new():
            looked.set()
            return True

        set_paused(PAUSE, is_new, refused.append)
        ros.spin_until(looked.is_set, "the look for the order")
        mission = ros.node("mission")

        def pause(_request, response):
            given.append("pause")
            response.success = True
            return response

        mission.create_service(Trigger, "~/pause", pause)
        ros.spin_until(lambda: given, "the order")
        assert refused == []

    def test_older_run_without_pause_service_is_refused(self, ros, set_paused):
        refused: list[str] = []
        set_paused(PAUSE, lambda: False, refused.append)
        ros.spin_until(lambda: refused, "the refusal")
        assert refused == ["no node of this tree executes 'pause'"]

    def test_missing_resume_command_is_refused_at_once(self, set_paused):
        refused: list[str] = []
        set_paused(RESUME, lambda: True, refused.append)
        assert refused == ["the mission has no command to resume it"]

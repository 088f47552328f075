"""Scores how often `sar-journal why` names the planted cause of a run of a shipped tree first.

Each run is one of `sar-run --sim` with one thing wrong. The line below "Likeliest cause:" must name that thing: the leaf that failed,
the time limit that expired, the script that was false, the command with its author, the process that was killed.

`python -m benchmarks.explaining [WORDS…]` prints the score, of those causes whose names contain one of the words.
"""

import multiprocessing
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from queue import Queue
from tempfile import TemporaryDirectory
from typing import Any

from benchmarks.commands import SCRIPTS

# One for each process.
_DOMAINS = ("71", "72", "73", "74")
_FAST, _SLOW = "1000", "20"
# The time limits of a run, and of its waits; seconds.
_RUN_SEC, _TRIGGER_SEC = 120.0, 60.0

PLAIN, RESILIENT = "search_and_rescue", "search_and_rescue_resilient"
GUARDED, AREAS, SWEEPS = "search_and_rescue_guarded", "search_areas", "search_sweeps"
_FAILSAFES = "failsafes"

_LEAVES = '''"""Leaves with a fault."""

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.leaves import Kind, register


@register("Raises", kind=Kind.ACTION)
class Raises(Behaviour):
    """Raises when it is ticked."""

    def __init__(self, name: str) -> None:
        super().__init__(name)

    def update(self) -> Status:
        """Raise."""
        raise RuntimeError("the camera has no lens")


@register("Stuck", kind=Kind.ACTION)
class Stuck(Behaviour):
    """Runs for ever."""

    def __init__(self, name: str) -> None:
        super().__init__(name)

    def update(self) -> Status:
        """Run."""
        return Status.RUNNING
'''


@dataclass(frozen=True)
class PlantedCause:
    """A run with one thing wrong.

    Attributes:
        kind: What is wrong, in words.
        named: A pattern that the line below "Likeliest cause:" must contain.
        tree: The shipped tree.
        edits: Replacements of text by the file of `trees/` in which they are made.
        options: Further options of `sar-run`.
        parameters: ROS parameters.
        files: Files that the options name, relative to the folder of the run.
        at: A pattern of the run's log; when a line contains it, `act` is called.
        act: A function that interferes with the run; its argument is the process.
        speed: Simulated seconds per second, at most.
    """

    kind: str
    named: str
    tree: str = RESILIENT
    edits: Mapping[str, tuple[tuple[str, str], ...]] = field(default_factory=dict)
    options: tuple[str, ...] = ()
    parameters: Mapping[str, str] = field(default_factory=dict)
    files: Mapping[str, str] = field(default_factory=dict)
    at: str = ""
    act: "Callable[[subprocess.Popen[str]], object] | None" = None
    speed: str = _FAST


def _fault(kind: str, named: str, *faults: str, tree: str = RESILIENT) -> PlantedCause:
    return PlantedCause(
        kind, named, tree, options=tuple(part for each in faults for part in ("--fault", each))
    )


def _edit(kind: str, named: str, old: str, new: str, tree: str = RESILIENT, file: str = "") -> PlantedCause:
    return PlantedCause(kind, named, tree, {file or tree: ((old, new),)})


def _command(kind: str, named: str, name: str, by: str = "", **more: Any) -> PlantedCause:
    act = partial(_give_command, name, by)
    return PlantedCause(kind, named, GUARDED, at="Navigating to zone_b", act=act, speed="10", **more)


def _property(kind: str, named: str, done: str, **more: Any) -> PlantedCause:
    text = f"properties:\n  nobody is found: {{never: DetectSurvivor found, if_broken: {done}}}\n"
    return PlantedCause(
        kind, named, GUARDED, options=("--properties", "p.yaml"), files={"p.yaml": text}, speed=_SLOW, **more
    )


class _Commander:
    """A node that calls the services of a run's commands; it starts before the run, so that discovery takes no time."""

    def __init__(self) -> None:
        import rclpy
        from rcl_interfaces.srv import SetParameters
        from rclpy.executors import SingleThreadedExecutor
        from std_srvs.srv import Trigger

        self._context = rclpy.Context()
        rclpy.init(context=self._context)
        node = rclpy.create_node("commander", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(node)
        self._parameters = node.create_client(SetParameters, f"/{PLAIN}/set_parameters")
        names = ("abort", "go_home", "skip_zone", "pause")
        self._clients = {name: node.create_client(Trigger, f"/{PLAIN}/{name}") for name in names}

    def give(self, name: str, by: str) -> None:
        """Give a command, signed by its author with a reason if there is one."""
        from rclpy.parameter import Parameter

        if by:
            signed = self._parameters.srv_type.Request()
            signed.parameters = [Parameter(f"ordered_by.{name}", value=[by, "smoke"]).to_parameter_msg()]
            self._call(self._parameters, signed)
        client = self._clients[name]
        self._call(client, client.srv_type.Request())

    def _call(self, client: Any, request: Any) -> None:
        if not client.wait_for_service(_TRIGGER_SEC):
            message = f"there is no service {client.srv_name}"
            raise TimeoutError(message)
        self._executor.spin_until_future_complete(client.call_async(request), timeout_sec=_TRIGGER_SEC)


@cache
def _commander() -> _Commander:
    return _Commander()


def _give_command(name: str, by: str, _run: "subprocess.Popen[str]") -> None:
    _commander().give(name, by)


def _kill(run: "subprocess.Popen[str]") -> None:
    run.kill()


def _interrupt(run: "subprocess.Popen[str]") -> None:
    run.send_signal(signal.SIGINT)


_DETECT = "<DetectSurvivor/>"
_DRIVE_LIMIT = 'name="WithinThreeMinutes" msec="180000"'
_HOME_LIMIT = 'name="WithinFiveMinutes" msec="300000"'
_LOOKS = '<ZonesRemaining name="ZonesRemaining?"/>'

CAUSES = (
    # Servers that refuse, are late, do not answer, or die.
    _fault(
        "a drive that is aborted",
        r"NavigateToZone FAILURE \(aborted\).*zone_d",
        "navigate_to_pose:abort=zone_d",
    ),
    _fault("goals that are rejected", r"NavigateToZone FAILURE.*rejected", "navigate_to_pose:reject=1000"),
    _fault("an error code of Nav2", r"NavigateToZone FAILURE.*206", "navigate_to_pose:code=206@zone_b"),
    _fault(
        "a navigation server that dies",
        r"Navigat\w+ FAILURE \(unavailable\).*bt_navigator",
        "navigate_to_pose:die@zone_b",
    ),
    _fault("a localisation that is lost", r"Navigat\w+ FAILURE \(unavailable\).*amcl", "amcl:die@zone_b"),
    PlantedCause(
        "no way home",
        r"NavigateToBase FAILURE",
        parameters={"base_station.x": "-3.5", "base_station.y": "0.0"},
    ),
    _fault(
        "a search that is never answered",
        r"DetectSurvivor FAILURE \(no answer\)",
        "detect_survivor:drop=1000",
    ),
    _fault(
        "a search that is answered too late",
        r"DetectSurvivor FAILURE \(no answer\)",
        "detect_survivor:delay=60",
    ),
    _fault(
        "reports that base refuses",
        r"(NotifyBase|Deliver\w+) FAILURE \(refused\)",
        "report_survivor:refuse=1000",
    ),
    _fault(
        "reports that base does not answer",
        r"(NotifyBase|Deliver\w+) FAILURE.*answer",
        "report_survivor:drop=1000",
    ),
    _fault(
        "a zone that a tree without retries cannot reach",
        r"NavigateToZone FAILURE \(aborted\).*zone_b",
        "navigate_to_pose:abort=zone_b",
        tree=PLAIN,
    ),
    _fault(
        "a piece of a sweep that cannot be reached",
        r"(Drive|Navigate|Sweep)\w* FAILURE \(\w+\).*aborted",
        "navigate_to_pose:abort=zone_b",
        tree=SWEEPS,
    ),
    # Time limits.
    _edit(
        "a time limit of a drive",
        r"WithinThreeMinutes FAILURE.*time limit of 2 s",
        _DRIVE_LIMIT,
        'name="WithinThreeMinutes" msec="2000"',
    ),
    _edit(
        "a time limit of the way home",
        r"WithinFiveMinutes FAILURE.*time limit of 2 s",
        _HOME_LIMIT,
        'name="WithinFiveMinutes" msec="2000"',
    ),
    _edit(
        "a time limit of a search",
        r"Quick FAILURE.*time limit",
        _DETECT,
        '<Timeout name="Quick" msec="1"><Sequence><Sleep msec="1000"/><DetectSurvivor/></Sequence></Timeout>',
    ),
    _edit(
        "the mission's time",
        r"MissionTimeLeft\? FAILURE.*20 s has expired",
        'limit="30min"',
        'limit="20s"',
        GUARDED,
        _FAILSAFES,
    ),
    PlantedCause("the time limit of the run", r"time limit of 0:20", parameters={"time_limit_sec": "20.0"}),
    # Scripts, loops, conditions, leaves.
    _edit(
        "a condition by script that is false",
        r"Ready FAILURE, 'battery_ok == true' is false",
        _DETECT,
        '<Sequence><Script code="battery_ok := false"/><ScriptCondition name="Ready" code="battery_ok == true"/><DetectSurvivor/></Sequence>',
    ),
    _edit(
        "a pre-condition that is true",
        r"DetectSurvivor\w* FAILURE.*_failureIf: tries >= 3",
        _DETECT,
        '<Sequence><Script code="tries := 3"/><DetectSurvivor _failureIf="tries >= 3"/></Sequence>',
    ),
    _edit(
        "a loop over nothing",
        r"EachView FAILURE.*no item",
        _DETECT,
        '<Sequence><LoopDouble name="EachView" queue="" value="{view}" if_empty="FAILURE"><AlwaysSuccess/></LoopDouble><DetectSurvivor/></Sequence>',
    ),
    _edit(
        "a leaf that always fails",
        r"AlwaysFailure FAILURE",
        _DETECT,
        "<Sequence><AlwaysFailure/><DetectSurvivor/></Sequence>",
    ),
    _edit(
        "a switch without the case",
        r"NoCase FAILURE",
        _DETECT,
        '<Sequence><Script code="mode := 3"/><Switch2 name="ByMode" variable="{mode}" case_1="1" case_2="2"><AlwaysSuccess/><AlwaysSuccess/><AlwaysFailure name="NoCase"/></Switch2><DetectSurvivor/></Sequence>',
    ),
    PlantedCause(
        "a leaf that raises",
        r"Raises.*the camera has no lens",
        edits={RESILIENT: ((_DETECT, "<Sequence><Raises/><DetectSurvivor/></Sequence>"),)},
        files={"faulty.py": _LEAVES},
        options=("--nodes", "faulty"),
    ),
    PlantedCause(
        "a leaf that never ends",
        r"Stuck RUNNING",
        edits={RESILIENT: ((_DETECT, "<Sequence><Stuck/><DetectSurvivor/></Sequence>"),)},
        files={"faulty.py": _LEAVES},
        options=("--nodes", "faulty"),
    ),
    # Failsafes.
    _edit(
        "a battery below its limit",
        r"BatterySuffices\? FAILURE.*below",
        'at_least="0.2"',
        'at_least="0.9999"',
        GUARDED,
        _FAILSAFES,
    ),
    _edit(
        "a battery that says nothing",
        r"BatterySuffices\? FAILURE.*no message on",
        'at_least="0.2"',
        'at_least="0.2" max_age_sec="0.000001"',
        GUARDED,
        _FAILSAFES,
    ),
    PlantedCause(
        "a geofence that is left",
        r"InsideFence\? FAILURE.*outside",
        GUARDED,
        parameters={"geofence": "[-5.0,-1.0,5.0,-1.0,5.0,5.0,-5.0,5.0]"},
        edits={},
    ),
    # Places and detections.
    PlantedCause(
        "a zone inside an obstacle",
        r"NavigateToZone FAILURE.*zone_b",
        parameters={"zones.zone_b.x": "0.0", "zones.zone_b.y": "3.0"},
    ),
    PlantedCause(
        "a zone beyond the walls", r"NavigateToZone FAILURE.*zone_b", parameters={"zones.zone_b.x": "30.0"}
    ),
    PlantedCause(
        "a detection at an unusable position",
        r"DetectSurvivor FAILURE.*\(99.00, 99.00\) is not on the map",
        GUARDED,
        parameters={
            "survivors.zone_a.x": "99.0",
            "survivors.zone_a.y": "99.0",
            "geofence": "[-5.9,-4.9,5.9,-4.9,5.9,4.9,-5.9,4.9]",
        },
    ),
    # Commands, of operators and of violated properties.
    _command(
        "a mission that an operator aborts", r"NotAborted\? FAILURE.*aborted.*Ann: smoke", "abort", "Ann"
    ),
    _command("an abort by a service call", r"NotAborted\? FAILURE.*aborted.*service call", "abort"),
    _command(
        "a robot that an operator calls home", r"NotRecalled\? FAILURE.*home.*Ann: smoke", "go_home", "Ann"
    ),
    _command(
        "a zone that an operator skips",
        r"NotHeld\? FAILURE \(zone skipped\).*zone_b.*Ann: smoke",
        "skip_zone",
        "Ann",
    ),
    _command(
        "a pause that never ends",
        r"NotHeld\? FAILURE \(held\).*paused.*Ann: smoke",
        "pause",
        "Ann",
        parameters={"time_limit_sec": "60.0"},
    ),
    _property(
        "a violated property that aborts",
        r"NotAborted\? FAILURE.*the property 'nobody is found'.*DetectSurvivor found",
        "abort",
    ),
    _property(
        "a violated property that pauses",
        r"NotHeld\? FAILURE \(held\).*the property 'nobody is found'.*DetectSurvivor found",
        "hold",
        parameters={"time_limit_sec": "60.0"},
    ),
    # Processes.
    PlantedCause(
        "a process that is killed",
        r"process.*(killed|crashed)",
        at="Navigating to zone_b",
        act=_kill,
        speed=_SLOW,
    ),
    PlantedCause(
        "a run that is interrupted", r"SIGINT|Ctrl-C", at="Navigating to zone_b", act=_interrupt, speed=_SLOW
    ),
)
"""The planted causes, each of a different kind."""


def score(causes: Sequence[PlantedCause]) -> list[str]:
    """Print what `why` names first for each cause, several at a time; return the kinds of the causes that it misses."""
    domains = multiprocessing.Manager().Queue()
    for domain in _DOMAINS:
        domains.put(domain)
    spawn = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(len(_DOMAINS), spawn, _set_domain, (domains,))
    try:
        missed = []
        for cause, (is_named, text) in zip(causes, pool.map(judge, map(CAUSES.index, causes)), strict=True):
            print(f"  {'named' if is_named else 'MISSED'}: {cause.kind}: {text}", flush=True)
            if not is_named:
                missed.append(cause.kind)
    finally:
        # After an error, the runs that have not started are cancelled.
        pool.shutdown(cancel_futures=True)
    print(f"  {len(causes) - len(missed)} of {len(causes)} causes are named first")
    return missed


def _set_domain(domains: "Queue[str]") -> None:
    """Give a process a separate ROS domain, so that its runs do not interact with others."""
    os.environ["ROS_DOMAIN_ID"] = domains.get()
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"


def judge(number: int) -> tuple[bool, str]:
    """Return whether the cause with a number is named first, and the line that is first; a run that does not end counts as missed."""
    cause = CAUSES[number]
    with TemporaryDirectory() as folder:
        try:
            text = first_named(cause, Path(folder))
        except (TimeoutError, subprocess.TimeoutExpired) as error:
            return False, str(error)
    return re.search(cause.named, text) is not None, text or "nothing"


def first_named(cause: PlantedCause, folder: Path) -> str:
    """Return the line of `sar-journal why` below "Likeliest cause:" about a run with a planted cause; empty if there is none.

    Args:
        cause: The cause.
        folder: An empty folder for the files of the run.

    Raises:
        TimeoutError: If the run does not reach the point at which `act` is called.
        subprocess.TimeoutExpired: If the run, or `why`, does not end.
    """
    journal = folder / "m.journal"
    _run(cause, folder, journal)
    why: list[str | Path] = [SCRIPTS / "sar-journal", "why", journal]
    told = subprocess.run(why, capture_output=True, text=True, check=False, cwd=folder, timeout=_RUN_SEC)
    _, _, after = told.stdout.partition("Likeliest cause:\n")
    return after.partition("\n")[0].strip()


def _run(cause: PlantedCause, folder: Path, journal: Path) -> None:
    trees = folder / "trees"
    shutil.copytree("trees", trees)
    for name, edits in cause.edits.items():
        path = trees / f"{name}.xml"
        text = path.read_text(encoding="utf-8")
        for old, new in edits:
            if old not in text:
                message = f"{cause.kind}: {old!r} is not in {name}.xml"
                raise ValueError(message)
            text = text.replace(old, new)
        path.write_text(text, encoding="utf-8")
    for name, text in cause.files.items():
        (folder / name).write_text(text, encoding="utf-8")
    ros = [part for name, value in cause.parameters.items() for part in ("-p", f"{name}:={value}")]
    command: list[str | Path] = [
        SCRIPTS / "sar-run",
        trees / f"{cause.tree}.xml",
        "--sim",
        "--speed",
        cause.speed,
    ]
    command += ["--journal", journal, *cause.options, "--ros-args", *ros]
    env = {**os.environ, "PYTHONPATH": str(folder)}
    if cause.act is not None:
        _commander()
    with (folder / "log").open("w", encoding="utf-8") as log:
        run = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT, text=True, env=env, cwd=folder)
        try:
            if cause.act is not None:
                _await(cause.at, folder / "log", run)
                cause.act(run)
            run.wait(_RUN_SEC)
        finally:
            with suppress(ProcessLookupError):
                run.kill()
            run.wait()


def _await(pattern: str, log: Path, run: "subprocess.Popen[str]") -> None:
    deadline = time.monotonic() + _TRIGGER_SEC
    while not re.search(pattern, log.read_text(encoding="utf-8")):
        if time.monotonic() > deadline or run.poll() is not None:
            message = f"{pattern!r} did not come in the log of the run"
            raise TimeoutError(message)
        time.sleep(0.05)


if __name__ == "__main__":
    score([each for each in CAUSES if not sys.argv[1:] or any(word in each.kind for word in sys.argv[1:])])

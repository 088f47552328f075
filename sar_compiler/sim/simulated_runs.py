"""Repeated runs of a mission in the simulator, in processes with separate ROS domains."""

import json
import random
import shlex
import subprocess
import tempfile
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import CancelledError, Executor, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, NamedTuple

from sar_compiler.analysis.sweep import RunResultSample
from sar_compiler.analysis.sweep.workers import ReplaceableExecutor
from sar_compiler.commands import FINDINGS, INTERRUPTED, OK, USAGE
from sar_compiler.errors import SarError
from sar_compiler.process_end import dependent_environment

# Ports of higher domains overlap with the range that Linux assigns to any process.
_DOMAINS = range(1, 102)
# Runs that were killed, or had other nodes in their domain, are repeated.
_MOST_ATTEMPTS = 4
# Part of the message of `sim.isolation` about other nodes.
_COMPANY = "must not mix with another one"

# A process is replaced after this many runs, which also frees whatever they leave behind.
_MOST_FLIGHTS = 50

_over = threading.Event()


class SimulatedRunError(SarError):
    """A mission cannot be run."""


@dataclass(frozen=True)
class SimulatedRuns:
    """Runs a mission with given seeds.

    Attributes:
        program: The command of a process that runs one mission after the other.
        arguments: The arguments of `sar-run` before the faults: the tree and the world among them.
        faults: The faults, as written.
        ros: The ROS arguments.
    """

    program: tuple[str, ...]
    arguments: tuple[str, ...]
    faults: tuple[str, ...] = ()
    ros: tuple[str, ...] = ()

    def command(self, seed: int) -> list[str]:
        """Return the arguments of `sar-run` for a seed."""
        faults = [part for fault in self.faults for part in ("--fault", fault)]
        ros = ["--ros-args", *self.ros] if self.ros else []
        return [*self.arguments, *faults, "--seed", str(seed), *ros]

    def __call__(self, seeds: Sequence[int]) -> list[RunResultSample]:
        """Return the result of a mission for each seed.

        Raises:
            SimulatedRunError: If it cannot be run.
            CancelledError: If the caller no longer waits for it.
        """
        return [self._outcome(seed) for seed in seeds]

    def _outcome(self, seed: int) -> RunResultSample:
        problem = ""
        for _ in range(_MOST_ATTEMPTS):
            status, output, problem = _execute_run(
                self.program, ["--format", "json", "--journal", "none", *self.command(seed)]
            )
            if _over.is_set() or status == INTERRUPTED:
                raise CancelledError
            # A process that ends before it responds may also have such a status.
            if status in (OK, FINDINGS) and output:
                said = json.loads(output.splitlines()[-1])
                reason = "" if status == OK else said["reason"] or "failed"
                size = (len(self.faults), said["ticks"])
                return RunResultSample(seed, reason, said["duration"], said["figures"], size)
            if status == USAGE and _COMPANY not in problem:
                break
        raise SimulatedRunError(f"sar-run {shlex.join(self.command(seed))}: {problem or f'status {status}'}")


class SimulatedRunResult(NamedTuple):
    """A mission that was run.

    Attributes:
        status: The exit status of `sar-run`; that of the process if it ended before.
        output: Its standard output.
        words: The end of its standard error.
    """

    status: int
    output: str = ""
    words: str = ""


class RunProcessSlot:
    """A process that runs missions one after the other, in a reserved ROS domain.

    Args:
        program: Its command.
    """

    def __init__(self, program: Sequence[str]) -> None:
        self._left = _MOST_FLIGHTS
        with _free_domain() as (domain, lock):
            self._process = subprocess.Popen(  # noqa: S603 - the project's own command
                program,
                env={**dependent_environment(), "ROS_DOMAIN_ID": str(domain)},
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                pass_fds=[lock.fileno()],
            )

    @property
    def is_usable(self) -> bool:
        """Whether it can run another mission."""
        return self._left > 0 and self._process.poll() is None

    def fly(self, arguments: Sequence[str]) -> SimulatedRunResult:
        """Run a mission."""
        self._left -= 1
        asked, answers = self._process.stdin, self._process.stdout
        assert asked is not None  # noqa: S101 - they are pipes
        assert answers is not None  # noqa: S101
        with suppress(BrokenPipeError):
            asked.write(json.dumps(arguments) + "\n")
            asked.flush()
        answer = answers.readline()
        if not answer:
            _, log = self._process.communicate()
            return SimulatedRunResult(self._process.returncode, words=log.strip().rpartition("\n")[2])
        flown = SimulatedRunResult(*json.loads(answer))
        if _COMPANY in flown.words:
            self._left = 0
        return flown

    def stop(self) -> None:
        """Stop the running mission gracefully."""
        self._process.terminate()

    def close(self) -> None:
        """End the idle process."""
        with suppress(BrokenPipeError):
            self._process.communicate()


_flying: set[RunProcessSlot] = set()
_waiting: list[RunProcessSlot] = []


def _execute_run(program: Sequence[str], arguments: Sequence[str]) -> SimulatedRunResult:
    """Run a mission in an existing process if possible."""
    pilot = _usable_process(program)
    _flying.add(pilot)
    try:
        return pilot.fly(arguments)
    finally:
        _flying.discard(pilot)
        if pilot.is_usable:
            _waiting.append(pilot)
        else:
            pilot.close()


def _usable_process(program: Sequence[str]) -> RunProcessSlot:
    while _waiting:
        pilot = _waiting.pop()
        if pilot.is_usable:
            return pilot
        pilot.close()
    return RunProcessSlot(program)


@contextmanager
def _free_domain() -> Iterator[tuple[int, IO[str]]]:
    """Reserve a ROS domain that no other sweep of this machine uses."""
    import fcntl

    for domain in random.sample(_DOMAINS, len(_DOMAINS)):
        path = Path(tempfile.gettempdir()) / f"sar_sim_domain_{domain}.lock"
        try:
            with path.open("a") as lock:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                yield domain, lock
                return
        except OSError:  # reserved, or another user's file
            continue
    raise SimulatedRunError("all ROS domains of this machine are used by other sweeps: wait until one ends")


def minimize_faults(runs: SimulatedRuns, seed: int) -> SimulatedRuns:
    """Return the runs with a minimal set of faults that still makes the mission of a seed fail."""
    for fault in runs.faults:
        fewer = replace(runs, faults=tuple(each for each in runs.faults if each != fault))
        if fewer([seed])[0].failure:
            runs = fewer
    return runs


def mission_threads(count: int) -> ReplaceableExecutor:
    """Return threads that each wait for a mission, and stop running missions at the end."""
    _over.clear()

    def stop(executor: Executor) -> None:
        _over.set()
        for pilot in list(_flying):
            pilot.stop()
        executor.shutdown(cancel_futures=True)
        while _waiting:
            _waiting.pop().close()
        _over.clear()

    return ReplaceableExecutor(lambda: ThreadPoolExecutor(count), count, stop)

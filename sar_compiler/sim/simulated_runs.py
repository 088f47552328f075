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

# The ports of higher domains overlap with the ephemeral ports of Linux.
_DOMAINS = range(1, 102)
# The maximum number of attempts for a run that was killed, or that had other nodes in its domain.
_MAX_ATTEMPTS = 4
# A part of the message of `sim.isolation` about other nodes.
_OTHER_NODES = "must not mix with another robot"

# The number of runs after which a process is replaced. This frees resources that the runs have leaked.
_MAX_RUNS = 50

_is_stopping = threading.Event()


class SimulatedRunError(SarError):
    """A mission cannot be run in the simulator."""


@dataclass(frozen=True)
class SimulatedRuns:
    """Runs a mission with given seeds.

    Attributes:
        program: The command line of a process that runs missions one after the other.
        arguments: The arguments of `sar-run` before the faults, including the tree and the world.
        faults: The faults, as the user has written them.
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
        """Run the mission with each seed, and return the results.

        Raises:
            SimulatedRunError: If the mission cannot be run.
            CancelledError: If the caller no longer waits for the results.
        """
        return [self._run_seed(seed) for seed in seeds]

    def _run_seed(self, seed: int) -> RunResultSample:
        problem = ""
        for _ in range(_MAX_ATTEMPTS):
            status, output, problem = _execute_run(
                self.program, ["--format", "json", "--journal", "none", *self.command(seed)]
            )
            if _is_stopping.is_set() or status == INTERRUPTED:
                raise CancelledError
            # A process that ends without a result may also have one of these statuses.
            if status in (OK, FINDINGS) and output:
                result = json.loads(output.splitlines()[-1])
                reason = "" if status == OK else result["reason"] or "failed"
                size = (len(self.faults), result["ticks"])
                return RunResultSample(seed, reason, result["duration"], result["figures"], size)
            if status == USAGE and _OTHER_NODES not in problem:
                break
        raise SimulatedRunError(f"sar-run {shlex.join(self.command(seed))}: {problem or f'status {status}'}")


class SimulatedRunResult(NamedTuple):
    """The result of a run of `sar-run`.

    Attributes:
        status: The exit status of `sar-run`, or of the process if the process ended without a result.
        output: The standard output of `sar-run`.
        problem: The reason for a failure, as printed on standard error.
    """

    status: int
    output: str = ""
    problem: str = ""


class RunProcessSlot:
    """A process that runs missions one after the other, in a reserved ROS domain.

    Args:
        program: The command line of the process.
    """

    def __init__(self, program: Sequence[str]) -> None:
        self._runs_left = _MAX_RUNS
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
        """Whether the process can run another mission."""
        return self._runs_left > 0 and self._process.poll() is None

    def execute(self, arguments: Sequence[str]) -> SimulatedRunResult:
        """Run a mission with the given arguments of `sar-run`, and wait for its result."""
        self._runs_left -= 1
        requests, results = self._process.stdin, self._process.stdout
        assert requests is not None  # noqa: S101 - they are pipes
        assert results is not None  # noqa: S101
        with suppress(BrokenPipeError):
            requests.write(json.dumps(arguments) + "\n")
            requests.flush()
        line = results.readline()
        if not line:
            _, log = self._process.communicate()
            return SimulatedRunResult(self._process.returncode, problem=log.strip().rpartition("\n")[2])
        result = SimulatedRunResult(*json.loads(line))
        if _OTHER_NODES in result.problem:
            self._runs_left = 0
        return result

    def stop(self) -> None:
        """Stop the running mission gracefully."""
        self._process.terminate()

    def close(self) -> None:
        """End the process. The process must be idle."""
        with suppress(BrokenPipeError):
            self._process.communicate()


_busy_processes: set[RunProcessSlot] = set()
_idle_processes: list[RunProcessSlot] = []


def _execute_run(program: Sequence[str], arguments: Sequence[str]) -> SimulatedRunResult:
    """Run a mission, in an existing process if one is idle."""
    process = _usable_process(program)
    _busy_processes.add(process)
    try:
        return process.execute(arguments)
    finally:
        _busy_processes.discard(process)
        if process.is_usable:
            _idle_processes.append(process)
        else:
            process.close()


def _usable_process(program: Sequence[str]) -> RunProcessSlot:
    while _idle_processes:
        process = _idle_processes.pop()
        if process.is_usable:
            return process
        process.close()
    return RunProcessSlot(program)


@contextmanager
def _free_domain() -> Iterator[tuple[int, IO[str]]]:
    """Reserve a ROS domain that no other sweep on this machine uses."""
    import fcntl

    for domain in random.sample(_DOMAINS, len(_DOMAINS)):
        path = Path(tempfile.gettempdir()) / f"sar_sim_domain_{domain}.lock"
        try:
            with path.open("a") as lock:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                yield domain, lock
                return
        except OSError:  # the domain is reserved, or the file belongs to another user
            continue
    raise SimulatedRunError("other sweeps use all ROS domains of this machine. Wait until one of them ends")


def minimize_faults(runs: SimulatedRuns, seed: int) -> SimulatedRuns:
    """Return the runs with a minimal set of faults that still makes the mission fail for a seed."""
    for fault in runs.faults:
        fewer = replace(runs, faults=tuple(each for each in runs.faults if each != fault))
        if fewer([seed])[0].failure:
            runs = fewer
    return runs


def mission_threads(count: int) -> ReplaceableExecutor:
    """Return a thread pool in which each thread waits for a run; stopping the pool stops the current runs."""
    _is_stopping.clear()

    def stop(executor: Executor) -> None:
        _is_stopping.set()
        for process in list(_busy_processes):
            process.stop()
        executor.shutdown(cancel_futures=True)
        while _idle_processes:
            _idle_processes.pop().close()
        _is_stopping.clear()

    return ReplaceableExecutor(lambda: ThreadPoolExecutor(count), count, stop)

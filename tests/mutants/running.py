"""Runs the tests that reach a mutant in a copy of the checkout."""

import bisect
import hashlib
import itertools
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from coverage import CoverageData
from coverage.exceptions import DataError

from tests.mutants.chosen_tests import CHOSEN, CURRENT, NOTED, PROCESSES
from tests.mutants.mutating import Mutant

_NOT_COPIED = shutil.ignore_patterns(".git", ".venv*", ".*_cache", ".hypothesis", "__pycache__", "build")
_PYTEST = (
    "-m",
    "pytest",
    "-q",
    "-p",
    "no:cacheprovider",
    "-p",
    "chosen_tests",
    "-m",
    "not slow and not nav2",
)
# The total seconds of the first round, which has the fastest tests. It kills most mutants.
_FIRST_SEC = 3.0
# The total seconds of the last round, which has tests that do not seem to reach the mutant.
_LAST_SEC = 60.0
# A test of another folder runs first only if it is faster by this factor.
_ELSEWHERE = 3.0
# Longer tests are left out: shorter ones check the same steps separately.
_LONGEST_SEC = 5.0
# Tests that take longer by this factor than without the mutant, plus the start time, count as endless.
_SLOWER, _START_SEC = 20.0, 120.0


class Bench:
    """A copy of a checkout, with the durations and the coverage of its tests.

    Args:
        root: The checkout.
        packages: The folders whose modules are mutated, relative to the checkout.
        cache: The folder that stores which tests reach which lines.
    """

    def __init__(self, root: Path, packages: Sequence[str], cache: Path) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="mutants-")
        self._copy = Path(self._folder.name) / "copy"
        shutil.copytree(root, self._copy, ignore=_NOT_COPIED, symlinks=True)
        # With hashes, Python recompiles a changed file even if its time is the same.
        compiled = ("-m", "compileall", "-q", "--invalidation-mode", "checked-hash", *packages)
        subprocess.run([sys.executable, *compiled], cwd=self._copy, check=True)
        modules = sorted(path for package in packages for path in (self._copy / package).rglob("*.py"))
        self._modules = {str(path.relative_to(self._copy)): _hash_of(path.read_bytes()) for path in modules}
        self._cache = cache.absolute() / _hash_of("\n".join(self._modules).encode())
        self._known = self._collect(packages)
        # A test that fails without a mutant proves nothing.
        self._seconds = {
            test: sec for test, sec in self._known.items() if sec is not None and sec < _LONGEST_SEC
        }
        self._reach = CoverageData(str(self._cache / "reach"))
        self._reach.read()
        self._killers: Counter[str] = Counter()

    def close(self) -> None:
        """Delete the copy."""
        self._folder.cleanup()

    def killer_of(self, mutant: Mutant) -> str:
        """Return a test that always fails with a mutant and passes without it; empty if there is none."""
        while killer := self._with(mutant, lambda: self._failing_of(self._rounds(mutant))):
            if killer not in self._seconds or (
                not self._failing([killer]) and self._with(mutant, lambda: self._failing([killer]))
            ):
                self._killers[killer] += 1
                return killer
            # The test is flaky, or fails in this environment.
            del self._seconds[killer]
        return ""

    def _with(self, mutant: Mutant, run: Callable[[], str]) -> str:
        """Apply a mutant during a run; return the result of the run."""
        path = self._copy / mutant.path
        source = path.read_bytes()
        path.write_bytes(mutant.applied(source))
        try:
            return run()
        finally:
            path.write_bytes(source)

    def _failing_of(self, rounds: list[list[str]]) -> str:
        return next(filter(None, map(self._failing, rounds)), "")

    def _collect(self, packages: Sequence[str]) -> dict[str, float | None]:
        """Return the seconds of each test, None if it fails; run tests of new files and record the lines that they reach."""
        self._cache.mkdir(parents=True, exist_ok=True)
        notes = self._cache / "notes.json"
        text = notes.read_text(encoding="utf-8") if notes.exists() else "[{}, {}]"
        collected, found = json.loads(text)
        self._collected: dict[str, str] = collected or self._modules
        files = sorted((self._copy / "tests").rglob("test_*.py"))
        hashes = {str(file.relative_to(self._copy)): _hash_of(file.read_bytes()) for file in files}
        known: dict[str, Any] = {file: own for file, own in found.items() if hashes.get(file) == own[0]}
        # Stored for each folder, so that an interrupted run can continue.
        unknown = [file for file in hashes if file not in known]
        for folder, group in itertools.groupby(unknown, _test_folder_of):
            sys.stderr.write(f"measuring {folder}\n")
            new = list(group)
            seconds = self._measure(packages, new)
            for file in new:
                own = {test: sec for test, sec in seconds.items() if test.partition("::")[0] == file}
                known[file] = [hashes[file], own]
            notes.write_text(json.dumps([self._collected, known]), encoding="utf-8")
        return {test: sec for _, own in known.values() for test, sec in own.items()}

    def _measure(self, packages: Sequence[str], files: list[str]) -> dict[str, float | None]:
        """Return the seconds of each test in some files, and record the lines that they and their processes reach."""
        folder = Path(tempfile.mkdtemp(dir=self._copy.parent))
        source = "".join(f"\n  {self._copy / package}" for package in packages)
        for name, more in (("tests", ""), ("processes", f"parallel = true\ncontext = ${{{CURRENT}-}}\n")):
            settings = f"[run]\ndata_file = {folder / name}_reach\n{more}source ={source}\n"
            (folder / f"{name}.ini").write_text(settings, encoding="utf-8")
        coverage = ("--cov", "--cov-context=test", "--cov-report=", f"--cov-config={folder / 'tests.ini'}")
        workers = min(os.cpu_count() or 1, len(files))
        parallel = ("-n", str(workers), "--dist", "worksteal") if workers > 1 else ()
        variables = {PROCESSES: str(folder / "processes.ini")}
        seconds, _ = self._run([*parallel, *coverage, *files], None, variables)
        reach = CoverageData(str(self._cache / "reach"))
        reach.read()
        for file in folder.glob("*_reach*"):
            data = CoverageData(str(file))
            try:
                data.read()
            except DataError:  # the writing process was killed
                continue
            reach.update(data, map_path=lambda path: os.path.relpath(path, self._copy))
        # Some tests fail only under coverage.
        if failed := [test for test, sec in seconds.items() if sec is None]:
            again, _ = self._run(_files_of(failed), None, self._ask(failed, list(seconds)))
            seconds |= again
        return seconds

    def _rounds(self, mutant: Mutant) -> list[list[str]]:
        """Return the tests to run: the fastest that reach the lines, then the others that do, then some more.

        The last round is for code that runs once in a process, which only the first test seems to reach.
        """
        near, folders = self.reaching(mutant), Path(mutant.path).parts[1:-1]

        def priority(test: str) -> tuple[int, float]:
            is_near = any(f"/{folder}/" in test for folder in folders)
            return -self._killers[test], self._seconds[test] * (1.0 if is_near else _ELSEWHERE)

        order = sorted(self._seconds, key=priority)
        first, rest = self._within(_FIRST_SEC, [test for test in order if test in near])
        last, _ = self._within(_LAST_SEC, [test for test in order if test not in near])
        return [tests for tests in (first, rest, last) if tests]

    def _within(self, seconds: float, tests: list[str]) -> tuple[list[str], list[str]]:
        """Return the first tests that together take at most some seconds, and the others."""
        ends = list(itertools.accumulate(self._seconds[test] for test in tests))
        count = bisect.bisect_right(ends, seconds)
        return tests[:count], tests[count:]

    def reaching(self, mutant: Mutant) -> set[str]:
        """Return the tests that reach the lines of a mutant, directly, in a process or in a fixture."""
        contexts = self._reach.contexts_by_lineno(mutant.path)
        is_as_it_was = self._collected[mutant.path] == self._modules[mutant.path]
        lines = mutant.lines if is_as_it_was else ()
        on_lines = {test for line in lines for test in contexts.get(line, []) if test}
        # Code that runs on import runs for all tests that use the module.
        found = on_lines or {test for tests in contexts.values() for test in tests if test}
        tests, begun = set(), set()
        for test, phase in map(_test_and_phase, found):
            tests.add(test)
            if phase == "setup":
                begun.add(test.partition("::")[0])
        # A fixture may serve all tests of the file.
        tests |= {test for test in self._seconds if test.partition("::")[0] in begun}
        return tests & self._seconds.keys()

    def _failing(self, tests: list[str]) -> str:
        limit = _START_SEC + _SLOWER * sum(self._seconds[test] for test in tests)
        noted, status = self._run(["-x", *_files_of(tests)], limit, self._ask(tests, list(self._known)))
        failed = [test for test, seconds in noted.items() if seconds is None]
        nothing_failed = status in (0, _NO_TESTS)
        return "" if nothing_failed else failed[0] if failed else _NO_END if status is None else _NO_START

    def _ask(self, tests: list[str], known: list[str]) -> dict[str, str]:
        """Return the variables that make pytest run some tests, and the tests that are not known."""
        asked = self._copy.parent / "asked.json"
        asked.write_text(json.dumps({"chosen": tests, "known": known}), encoding="utf-8")
        return {CHOSEN: str(asked)}

    def _run(
        self, arguments: Sequence[str], limit_sec: float | None, variables: dict[str, str] | None = None
    ) -> tuple[dict[str, float | None], int | None]:
        """Run pytest in the copy; return the seconds of its tests, and its exit status, None if it did not end."""
        notes = self._copy.parent / "noted.json"
        notes.write_text("{}", encoding="utf-8")
        path = os.pathsep.join([str(self._copy), str(Path(__file__).parent)])
        kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
        process = subprocess.Popen(
            [sys.executable, *_PYTEST, *arguments],
            cwd=self._copy,
            env={**kept, "PYTHONPATH": path, NOTED: str(notes), **(variables or {})},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        try:
            status: int | None = process.wait(limit_sec)
        except subprocess.TimeoutExpired:
            status = None
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()
        return json.loads(notes.read_text(encoding="utf-8")), status


def _test_folder_of(file: str) -> str:
    """Return the folder of `tests` that a file is in."""
    return "/".join(Path(file).parent.parts[:2])


def _files_of(tests: list[str]) -> list[str]:
    return list(dict.fromkeys(test.partition("::")[0] for test in tests))


def _test_and_phase(context: str) -> tuple[str, str]:
    """Return the test and the phase in a coverage context: `test|setup`, or `test (setup)` in a child process."""
    test, _, phase = context.removesuffix(")").rpartition("|" if "|" in context[-10:] else " (")
    return test, phase


_NO_TESTS = 5
_NO_END, _NO_START = "tests that do not end", "tests that cannot be read"


def _hash_of(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:16]

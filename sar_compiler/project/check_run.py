"""The checks of the files that a command names: from stored results, in copies of this process, or in this process."""

import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sar_compiler.budget import Budget
from sar_compiler.opener import STANDARD_INPUT, Observation
from sar_compiler.project.check_cache import (
    CheckCache,
    add_modules,
    check_of,
    data_of,
    data_of_observation,
    observation_of,
)
from sar_compiler.project.file_check import FileCheck
from sar_compiler.tree.json_values import json_text, json_value

if TYPE_CHECKING:
    from sar_compiler.project.file_checker import FileChecker
    from sar_compiler.project.forked_workers import ForkedWorkers

FEWEST_FOR_COPIES = 20
"""The minimum number of files for which copies of the process save more time than they cost."""
_MOST_COPIES = 8


class CheckRun:
    """The checks of some files.

    Args:
        files: The files.
        make_checker: Creates their checker; called only if results are missing.
        cache: Stored results; None for none.
        work: The limit for exploring the runs of a file, in units of work; None for no limit.
        budget: The limits of the checks.

    Attributes:
        others_sec: The processor time that copies of this process have used, seconds.
    """

    def __init__(
        self,
        files: Sequence[Path],
        make_checker: "Callable[[], FileChecker]",
        cache: CheckCache | None,
        work: int | None,
        budget: Budget,
    ) -> None:
        self.others_sec = 0.0
        self._files, self._budget = files, budget
        self._cache = None if STANDARD_INPUT in files else cache
        self._results: dict[int, FileCheck] = {}
        for number, path in enumerate(files):
            if self._cache is not None and (kept := self._cache.find(path, work)) is not None:
                self._results[number] = kept
        self._missing = [number for number in range(len(files)) if number not in self._results]
        self._checker = make_checker() if self._missing else None
        self._copies: ForkedWorkers | None = None
        self._count = 1
        self._others = Observation()
        self._reads_set = False
        self._sent = self._modules = 0
        self._cpu: dict[int, float] = {}

    def make_copies(self, max_sec: float) -> None:
        """Create copies of this process if there is enough work for them; call it before any thread is started.

        Args:
            max_sec: The processor time of each copy, seconds.
        """
        if len(self._missing) < FEWEST_FOR_COPIES:
            return
        from sar_compiler.project.forked_workers import ForkedWorkers

        affinity = getattr(os, "sched_getaffinity", None)
        count = min(len(affinity(0)) if affinity else os.cpu_count() or 1, _MOST_COPIES)
        if count > 1 and ForkedWorkers.are_possible():
            import sar_compiler.checks.schema_validation
            import sar_compiler.tree.xml  # noqa: F401 - once for all copies

            self._count = count
            self._copies = ForkedWorkers(self._check_in_copy, self._missing, count, max_sec)

    def _check_in_copy(self, number: int) -> str | None:
        checker = self._checker
        assert checker is not None  # noqa: S101 - there are files to check
        if not self._sent:
            self._budget.divide_memory(self._count)
        try:
            check = checker.check(self._files[number])
        except Exception:  # noqa: BLE001 - it is raised again where it is reported
            return None
        observed = checker.surroundings
        if self._cache is not None and self._modules != len(sys.modules):
            self._modules = len(sys.modules)
            add_modules(observed)
        new = Observation(islice(observed.items(), self._sent, None))
        self._sent = len(observed)
        return json_text(
            {
                "check": data_of(check),
                "surroundings": data_of_observation(new),
                "is_consistent": observed.is_consistent and check.sources.is_consistent,
                "reads_set": checker.reads_set,
                "process": os.getpid(),
                "cpu_sec": time.process_time(),
                "reason": self._budget.reason,
            }
        )

    def _receive(self, message: dict[str, Any]) -> FileCheck:
        for question, answer in observation_of(message["surroundings"]).items():
            self._others.record(question, answer)
        self._others.is_consistent = self._others.is_consistent and message["is_consistent"]
        self._reads_set = self._reads_set or message["reads_set"]
        self._cpu[message["process"]] = message["cpu_sec"]
        self.others_sec = sum(self._cpu.values())
        if message["reason"]:
            self._budget.spend(message["reason"])
        return check_of(message["check"])

    def results(self) -> Iterator[tuple[Path, FileCheck]]:
        """Yield each file with its result, in the order of the files."""
        answers = iter(()) if self._copies is None else self._copies.results(self._budget.is_spent)
        for number, path in enumerate(self._files):
            while number not in self._results and (answer := next(answers, None)) is not None:
                done, text = answer
                if text is not None:
                    self._results[done] = self._receive(json_value(text))
                elif done == number:
                    break
            if number not in self._results:
                if self._budget.is_spent():
                    return
                assert self._checker is not None  # noqa: S101 - there are files to check
                self._results[number] = self._checker.check(path)
            yield path, self._results[number]

    def end(self) -> None:
        """Terminate the copies, and store the results for the next command."""
        if self._copies is not None:
            self._copies.end()
        if self._cache is not None and self._checker is not None:
            for question, answer in self._checker.surroundings.items():
                self._others.record(question, answer)
            self._others.is_consistent = (
                self._others.is_consistent and self._checker.surroundings.is_consistent
            )
            new = {
                self._files[number]: self._results[number]
                for number in self._missing
                if number in self._results
            }
            reads_set = self._reads_set or self._checker.reads_set
            self._cache.store(new, self._others, reads_set=reads_set)

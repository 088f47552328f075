"""Run functions of sweep tests, in a module of their own so that worker processes can import them."""

import os
import signal
from dataclasses import dataclass
from pathlib import Path

from sar_compiler.analysis.sweep import RunResultSample


def odd_ones_fail(seeds):
    return [
        RunResultSample(seed, "odd" if seed % 2 else "", float(seed), {"seen": seed}, (seed,))
        for seed in seeds
    ]


def all_succeed(seeds):
    return [RunResultSample(seed, "", 1.0) for seed in seeds]


@dataclass(frozen=True)
class EndsItsWorker:
    """Kills its own process a number of times, counted by files in a folder."""

    folder: Path
    times: int

    def __call__(self, seeds):
        if len(list(self.folder.iterdir())) < self.times:
            (self.folder / str(os.getpid())).touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return odd_ones_fail(seeds)

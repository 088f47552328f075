"""Looking around before a simulation begins, which takes some seconds where others are there, so that it is said."""

import sys
import time
from typing import Any

from sar_compiler.ros.signals import StopSignals
from sar_compiler.sim.isolation import LOOK_AROUND_SEC, LOOKING_AROUND, refuse_company
from sar_compiler.terminal import ProgressLine


def look_around(signals: StopSignals, **options: Any) -> None:
    """Refuse the company of other simulations and robots; on a terminal say how long that still takes.

    Args:
        signals: End it.
        options: Of `refuse_company`.

    Raises:
        IsolationError: If somebody is there.
    """
    line, ends = ProgressLine(), time.monotonic() + LOOK_AROUND_SEC

    def begin() -> None:
        print(LOOKING_AROUND, file=sys.stderr, flush=True)

    def should_stop() -> bool:
        line.show(lambda: f"{max(0.0, ends - time.monotonic()):.0f} s left")
        return signals.came

    try:
        refuse_company(on_waiting=begin, should_stop=should_stop, **options)
    finally:
        line.clear()

"""Before a simulation starts, check that no other simulation or robot is present. The check can take several seconds."""

import sys
import time
from typing import Any

from sar_compiler.ros.signals import StopSignals
from sar_compiler.sim.isolation import LOOK_AROUND_SEC, LOOKING_AROUND, require_no_other_nodes
from sar_compiler.terminal import ProgressLine


def require_isolation(signals: StopSignals, **options: Any) -> None:
    """Check that no other simulation or robot is present; on a terminal, show the remaining time.

    Args:
        signals: The requests to stop; such a request ends the check.
        options: Keyword arguments of `require_no_other_nodes`.

    Raises:
        IsolationError: If another simulation or robot is present.
    """
    line, ends = ProgressLine(), time.monotonic() + LOOK_AROUND_SEC

    def begin() -> None:
        print(LOOKING_AROUND, file=sys.stderr, flush=True)

    def should_stop() -> bool:
        line.show(lambda: f"{max(0.0, ends - time.monotonic()):.0f} s left")
        return signals.came

    try:
        require_no_other_nodes(on_waiting=begin, should_stop=should_stop, **options)
    finally:
        line.clear()

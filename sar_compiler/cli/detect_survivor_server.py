"""`sar-detect-survivor-server`: the service `detect_survivor`, as a command."""

import sys
from collections.abc import Sequence

from sar_compiler.cli.arguments import run
from sar_compiler.ros.signals import StopSignals


def main(argv: Sequence[str] | None = None) -> int:
    """Run `sar-detect-survivor-server` and return its exit status."""
    # Before anything that takes time, so that Ctrl-C ends the command in order from its first moment.
    signals = StopSignals()
    return run(lambda: _serve(argv, signals), "sar-detect-survivor-server")


def _serve(argv: Sequence[str] | None, signals: StopSignals) -> int:
    from sar_compiler.ros.detect_survivor_server import main as serve

    return serve(argv, signals)


if __name__ == "__main__":
    sys.exit(main())

"""Run a command in the process of the tests."""

import signal

from sar_compiler.cli.compile import main


def run(capsys, *arguments):
    """Run `sar-compile`; return its exit status, and what it printed on standard output and on standard error."""
    status = main([str(argument) for argument in arguments])
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def press_ctrl_c(budget):
    """Send SIGINT the first time that an analysis checks its budget; replaces `Budget.is_spent`."""
    if not budget.is_interrupted:
        signal.raise_signal(signal.SIGINT)
    return budget.is_interrupted

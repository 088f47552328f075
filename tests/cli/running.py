"""Running a command in the process of the tests."""

from sar_compiler.cli.compile import main


def run(capsys, *arguments):
    """Run `sar-compile`; return its exit status, and what it printed on standard output and on standard error."""
    status = main([str(argument) for argument in arguments])
    captured = capsys.readouterr()
    return status, captured.out, captured.err

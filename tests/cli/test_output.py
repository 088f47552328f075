"""Standard output of a run: whole lines, and what becomes of a run whose output is closed."""

import io
import os
import sys
from contextlib import contextmanager

import pytest

from sar_compiler.commands import print_error
from sar_compiler.terminal import RunOutput


@contextmanager
def closed_pipe(monkeypatch):
    """Let standard output be a pipe that nobody reads."""
    reader, writer = os.pipe()
    os.close(reader)
    # Closing flushes what is left in the buffer, as Python does at its end.
    with os.fdopen(writer, "w", encoding="utf-8") as stream, monkeypatch.context() as patch:
        patch.setattr(sys, "stdout", stream)
        yield


def test_what_is_shown_and_said_stands_on_standard_output(capsys):
    output = RunOutput()
    output.print_momentary("a tree")
    output.print_important("a summary")
    assert capsys.readouterr() == ("a tree\na summary\n", "")


class Pieces(io.BytesIO):
    """Keeps what is written to it each time, if it is anything."""

    def __init__(self):
        super().__init__()
        self.written = []

    def write(self, data):
        if data:
            self.written.append(bytes(data))
        return len(data)


@pytest.mark.parametrize(("name", "show"), [("stdout", RunOutput().print_momentary), ("stderr", print_error)])
def test_a_line_is_written_in_one_piece_so_that_the_log_comes_between_lines(monkeypatch, name, show):
    pieces = Pieces()
    # As Python itself has it with PYTHONUNBUFFERED.
    with io.TextIOWrapper(pieces, encoding="utf-8", write_through=True) as stream:
        monkeypatch.setattr(sys, name, stream)
        show("a tree\nwith a leaf")
        assert pieces.written == [b"a tree\nwith a leaf\n"]
        monkeypatch.undo()


def test_that_nobody_reads_any_more_is_said_once_on_standard_error(capsys, monkeypatch):
    with closed_pipe(monkeypatch):
        output = RunOutput()
        output.print_momentary("a tree")
        output.print_momentary("another tree")
    assert output.lost
    assert capsys.readouterr().err == (
        "sar-run: standard output can no longer be written (Broken pipe). The run continues without output\n"
    )


def test_what_somebody_should_see_is_said_on_standard_error_then(capsys, monkeypatch):
    with closed_pipe(monkeypatch):
        RunOutput().print_important("a summary")
    assert capsys.readouterr().err.endswith("The run continues without output\na summary\n")


def test_a_drawing_that_the_terminal_cannot_show_does_not_end_the_run(capsys, monkeypatch, tmp_path):
    with (tmp_path / "out").open("w", encoding="ascii") as stream, monkeypatch.context() as patch:
        patch.setattr(sys, "stdout", stream)
        RunOutput().print_momentary("ZonesRemaining? [✓]")
    assert "'ascii' codec can't encode" in capsys.readouterr().err

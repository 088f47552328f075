"""Tests of the standard output of a run: whole lines, and a closed output."""

import io
import os
import sys
from contextlib import contextmanager

import pytest

from sar_compiler.commands import print_error
from sar_compiler.terminal import RunOutput


@contextmanager
def closed_pipe(monkeypatch):
    """Make standard output a pipe without a reader."""
    reader, writer = os.pipe()
    os.close(reader)
    # Closing flushes the buffer, as Python does at exit.
    with os.fdopen(writer, "w", encoding="utf-8") as stream, monkeypatch.context() as patch:
        patch.setattr(sys, "stdout", stream)
        yield


def test_momentary_and_important_text_goes_to_standard_output(capsys):
    output = RunOutput()
    output.print_momentary("a tree")
    output.print_important("a summary")
    assert capsys.readouterr() == ("a tree\na summary\n", "")


class WriteRecorder(io.BytesIO):
    """Stores the data of each write that is not empty."""

    def __init__(self):
        super().__init__()
        self.written = []

    def write(self, data):
        if data:
            self.written.append(bytes(data))
        return len(data)


@pytest.mark.parametrize(("name", "show"), [("stdout", RunOutput().print_momentary), ("stderr", print_error)])
def test_text_is_written_in_one_piece(monkeypatch, name, show):
    pieces = WriteRecorder()
    # As with PYTHONUNBUFFERED.
    with io.TextIOWrapper(pieces, encoding="utf-8", write_through=True) as stream:
        monkeypatch.setattr(sys, name, stream)
        show("a tree\nwith a leaf")
        assert pieces.written == [b"a tree\nwith a leaf\n"]
        monkeypatch.undo()


def test_closed_output_is_reported_once_on_standard_error(capsys, monkeypatch):
    with closed_pipe(monkeypatch):
        output = RunOutput()
        output.print_momentary("a tree")
        output.print_momentary("another tree")
    assert output.lost
    assert capsys.readouterr().err == (
        "sar-run: standard output can no longer be written (Broken pipe). The run continues without output\n"
    )


def test_important_text_goes_to_standard_error_if_output_is_closed(capsys, monkeypatch):
    with closed_pipe(monkeypatch):
        RunOutput().print_important("a summary")
    assert capsys.readouterr().err.endswith("The run continues without output\na summary\n")


def test_drawing_that_cannot_be_encoded_does_not_end_run(capsys, monkeypatch, tmp_path):
    with (tmp_path / "out").open("w", encoding="ascii") as stream, monkeypatch.context() as patch:
        patch.setattr(sys, "stdout", stream)
        RunOutput().print_momentary("ZonesRemaining? [✓]")
    assert "'ascii' codec can't encode" in capsys.readouterr().err

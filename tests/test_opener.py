"""Tests of the opener: it reads the file that was checked, even if the name refers to another file by then."""

import os
import pickle
import subprocess
import sys
import threading
from contextlib import closing, suppress
from pathlib import Path
from typing import TextIO

import pytest

from sar_compiler import opener
from sar_compiler.opener import (
    DOCUMENT,
    FileKind,
    MissingFileError,
    NamedPath,
    PathOutsideError,
    UnreadableFileError,
    folder_entries,
    open_by_name,
    read_file,
    regular_file,
    require_regular,
)

SMALL = FileKind("small file", 10)


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "inside").mkdir()
    (tmp_path / "secret").write_text("secret", encoding="utf-8")
    (tmp_path / "inside" / "file").write_text("open", encoding="utf-8")
    return tmp_path


def test_content_has_real_path_and_identity_of_file(folder):
    Path("link").symlink_to("inside/file")
    first, second = read_file("link", DOCUMENT), read_file("inside/file", DOCUMENT)
    assert (first.path, first.real_path, first.data) == (Path("link"), folder / "inside" / "file", b"open")
    assert first.identity == second.identity
    Path("inside/file").write_text("changed", encoding="utf-8")
    assert read_file("link", DOCUMENT).identity != first.identity


def test_file_at_limit_is_complete_and_larger_one_is_not_read_further():
    Path("file").write_bytes(b"x" * 10)
    assert read_file("file", SMALL).all_bytes() == b"x" * 10
    Path("file").write_bytes(b"x" * 1000)
    content = read_file("file", SMALL)
    assert len(content.data) == 11
    with pytest.raises(
        UnreadableFileError, match=r"cannot read file: it is larger than 0 KiB, the limit of a small file"
    ):
        content.all_bytes()


def test_text_is_decoded_without_bom_and_invalid_byte_is_reported():
    Path("file").write_bytes(b"\xef\xbb\xbfa")
    assert read_file("file", SMALL).decode() == "a"
    Path("file").write_bytes(b"a\xff")
    with pytest.raises(UnreadableFileError, match=r"it is not UTF-8 text \(byte 1\)"):
        read_file("file", SMALL).decode()


@pytest.mark.parametrize("name", ["a\0b", "a\ud800b", "x" * 300, "d/" * 3000])
def test_impossible_file_name_is_an_unreadable_file_error(name):
    with pytest.raises(UnreadableFileError, match="cannot read "):
        read_file(name, DOCUMENT)


def test_missing_file_has_its_own_error():
    with pytest.raises(MissingFileError, match="cannot read nowhere: No such file or directory"):
        read_file("nowhere", DOCUMENT)


def test_shell_pipe_is_read_to_its_end():
    reading, writing = os.pipe()
    os.write(writing, b"open")
    os.close(writing)
    assert read_file(f"/dev/fd/{reading}", DOCUMENT).data == b"open"
    os.close(reading)


def test_reader_of_shell_pipe_waits_for_its_writer():
    reading, writing = os.pipe()
    found = []
    reader = threading.Thread(target=lambda: found.append(read_file(f"/dev/fd/{reading}", DOCUMENT).data))
    reader.start()
    os.write(writing, b"late")
    os.close(writing)
    reader.join(60.0)
    assert found == [b"late"]
    os.close(reading)


INSIDE = ["inside/file", "inside/link", "inside/absolute", "inside/../inside/file"]
OUTSIDE = ["secret", "inside/out", "inside/../secret", "inside/missing_out", "/proc/self/environ"]


@pytest.fixture
def links(folder):
    Path("inside/link").symlink_to("file")
    Path("inside/absolute").symlink_to(folder / "inside" / "file")
    Path("inside/out").symlink_to("../secret")
    Path("inside/missing_out").symlink_to("../missing")


@pytest.mark.usefixtures("links")
class TestConfinedPath:
    @pytest.mark.parametrize("path", INSIDE)
    def test_links_inside_the_folder_are_followed(self, path, folder):
        named = NamedPath.confined_to(Path(path), [folder / "inside"])
        assert read_file(named, DOCUMENT).data == b"open"

    @pytest.mark.parametrize("path", OUTSIDE)
    def test_path_outside_the_folder_is_not_read_even_if_missing(self, path, folder):
        named = NamedPath.confined_to(Path(path), [folder / "inside"])
        with pytest.raises(PathOutsideError, match=f"it is outside {folder}/inside$"):
            read_file(named, DOCUMENT)

    def test_shell_pipe_is_outside_every_folder(self, folder):
        reading, writing = os.pipe()
        with pytest.raises(PathOutsideError):
            read_file(NamedPath.confined_to(Path(f"/dev/fd/{reading}"), [folder]), DOCUMENT)
        os.close(reading)
        os.close(writing)

    def test_pickled_path_keeps_its_folders(self, folder):
        named = pickle.loads(pickle.dumps(NamedPath.confined_to(Path("secret"), [folder / "inside"])))  # noqa: S301
        assert named == Path("secret")
        with pytest.raises(PathOutsideError):
            read_file(named, DOCUMENT)

    @pytest.mark.parametrize("path", [*INSIDE, *OUTSIDE])
    def test_confinement_is_the_same_without_file_handles(self, path, folder, monkeypatch):
        monkeypatch.setattr(opener, "_HANDLE_ONLY", None)
        monkeypatch.setattr(opener, "_DESCRIPTORS", folder / "no_proc")
        named = NamedPath.confined_to(Path(path), [folder / "inside"])
        if path in INSIDE:
            assert read_file(named, DOCUMENT).data == b"open"
        else:
            with pytest.raises(PathOutsideError):
                read_file(named, DOCUMENT)


@pytest.mark.parametrize("exchanged", ["inside/file", "inside"])
def test_link_created_after_path_resolution_is_not_followed(folder, monkeypatch, exchanged):
    monkeypatch.setattr(opener, "_HANDLE_ONLY", None)
    monkeypatch.setattr(opener, "_DESCRIPTORS", folder / "no_proc")
    outside = folder / "outside"
    outside.mkdir()
    (outside / "file").write_text("secret", encoding="utf-8")
    resolved = str(folder / "inside" / "file")
    Path(exchanged).rename("before")
    Path(exchanged).symlink_to(outside / "file" if exchanged.endswith("file") else outside)
    monkeypatch.setattr(os.path, "realpath", lambda _: resolved)
    with pytest.raises(UnreadableFileError, match="repeatedly replaced"):
        read_file(NamedPath.confined_to(Path("inside/file"), [folder / "inside"]), DOCUMENT)


@pytest.mark.parametrize("has_handles", [True, False])
def test_file_replaced_between_check_and_open_is_never_read_outside(folder, monkeypatch, has_handles):
    """A thread replaces the file by a link and back hundreds of times during the reads."""
    if not has_handles:
        monkeypatch.setattr(opener, "_HANDLE_ONLY", None)
        monkeypatch.setattr(opener, "_DESCRIPTORS", folder / "no_proc")
    stop, rounds = threading.Event(), []

    def exchange():
        while not stop.is_set():
            Path("inside/new").symlink_to("../secret")
            Path("inside/new").replace("inside/file")
            Path("inside/new").write_text("open", encoding="utf-8")
            Path("inside/new").replace("inside/file")
            rounds.append(1)

    thread = threading.Thread(target=exchange)
    thread.start()
    named, read = NamedPath.confined_to(Path("inside/file"), [folder / "inside"]), {b"open": 0, b"": 0}
    try:
        while read[b"open"] < 200 or len(rounds) < 200:
            # The new file is empty until the thread has written to it.
            with suppress(UnreadableFileError):
                read[read_file(named, DOCUMENT).data] += 1
    finally:
        stop.set()
        thread.join()
    assert set(read) == {b"open", b""}


CONFINED = """
import sys
from pathlib import Path
from sar_compiler.opener import *
from sar_compiler.opener import METADATA, TREE
confine([Path.cwd() / "inside"], "the folder of the agent")
for path, kind in [("inside/file", TREE), ("secret", TREE), ("secret", METADATA), ("inside/out", TREE)]:
    try:
        print(read_file(path, kind).data.decode())
    except PathOutsideError as error:
        print(error)
for folder in ["inside", "."]:
    try:
        print([each.name for each in folder_entries(Path(folder))])
    except PathOutsideError as error:
        print(error)
"""


def test_confined_process_reads_only_its_folders_and_installed_files():
    Path("inside/out").symlink_to("../secret")
    done = subprocess.run([sys.executable, "-c", CONFINED], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == [
        "open",
        "cannot read secret: it is outside the folder of the agent",
        "secret",
        "cannot read inside/out: it is outside the folder of the agent",
        "['file', 'out']",
        "cannot read .: it is outside the folder of the agent",
    ]


def test_require_regular_refuses_a_pipe():
    require_regular("inside/file")
    os.mkfifo("pipe")
    with pytest.raises(UnreadableFileError, match="it is a pipe, not a file"):
        require_regular("pipe")


@pytest.mark.parametrize("lists_descriptors", [True, False])
def test_open_by_name_opens_the_checked_file_or_fails(monkeypatch, lists_descriptors):
    path = Path("inside/file")
    if not lists_descriptors:
        monkeypatch.setattr(opener, "_open_files", set)
    with regular_file(path) as checked:
        with closing(open_by_name(path, checked, path.open)) as opened:
            assert opened.read() == "open"
        path.unlink()
        path.symlink_to("../secret")
        others: list[TextIO] = []

        def open_another() -> TextIO:
            others.append(path.open())
            return others[0]

        with pytest.raises(
            UnreadableFileError, match="cannot read inside/file: it was replaced while it was opened"
        ):
            open_by_name(path, checked, open_another)
    assert others[0].closed


def test_folder_entries_are_sorted_and_a_file_has_none():
    assert folder_entries(Path()) == [Path("inside"), Path("secret")]
    with pytest.raises(UnreadableFileError, match="cannot read secret: Not a directory"):
        folder_entries(Path("secret"))

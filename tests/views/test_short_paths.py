"""Tests of shortened paths in reports: relative to a folder above them, or to `~`."""

from pathlib import Path

import pytest

from sar_compiler.journal.journal_entries import JournalEntry
from sar_compiler.reports.mission_report import PathShortener


@pytest.fixture
def shorten(monkeypatch):
    """Return a function that shortens a text for a journal in /home/ada/state, with the current folder /work/site."""
    monkeypatch.setenv("HOME", "/home/ada")
    monkeypatch.setattr(Path, "cwd", lambda: Path("/work/site"))
    paths = PathShortener(Path("/home/ada/state"))

    def told(text, kind="note"):
        return paths.shorten(JournalEntry(1, 1, 0.0, 0.0, kind, {"text": text})).data["text"]

    return told


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("/home/ada/state/m.journal", "m.journal"),
        ("/work/site/maps/yard.pgm", "maps/yard.pgm"),
        ("/home/ada/photos/1.jpg", "~/photos/1.jpg"),
        ("/home/ada", "~"),
        ("/work/site", "."),
        ("'/work/site/a.xml', line 3: see /home/ada/b.xml:4", "'a.xml', line 3: see ~/b.xml:4"),
        ("/etc/ros/m.yaml", "/etc/ros/m.yaml"),
        ("/home/adam/m.yaml", "/home/adam/m.yaml"),
        ("/work/site-2/m.yaml", "/work/site-2/m.yaml"),
        ("/mnt/work/site/m.yaml", "/mnt/work/site/m.yaml"),
        ("file:///work/site/m.yaml", "file:///work/site/m.yaml"),
    ],
)
def test_path_is_shortened_to_nearest_known_folder(shorten, text, told):
    assert shorten(text) == told


def test_paths_in_nested_values_are_shortened(shorten):
    assert shorten({"maps": ["/home/ada/a.pgm", 3, None]}) == {"maps": ["~/a.pgm", 3, None]}


def test_log_lines_are_shortened_and_map_entries_are_not(shorten):
    assert shorten("/home/ada/x", kind="log") == "~/x"
    assert shorten("/home/ada/x", kind="map") == "/home/ada/x"


def test_paths_are_unchanged_without_home_folder(monkeypatch):
    monkeypatch.setattr("os.path.expanduser", lambda path: path)
    data = {"text": "/home/ada/x, ~/y"}
    entry = JournalEntry(1, 1, 0.0, 0.0, "note", data)
    assert PathShortener(Path("/srv")).shorten(entry).data == data


@pytest.mark.parametrize(
    ("files", "told"),
    [
        (["/srv/robot/trees/m.xml", "/srv/robot/trees/sub/n.xml"], ["m.xml", "sub/n.xml"]),
        (["/srv/robot/trees/m.xml", "/srv/robot/more/n.xml"], ["trees/m.xml", "more/n.xml"]),
        (["/m.xml", "/etc/n.xml"], ["/m.xml", "/etc/n.xml"]),
        (["m.xml", ""], ["m.xml", ""]),
    ],
)
def test_tree_files_are_shortened_to_their_common_folder(files, told):
    first, other = ({"name": "n", "children": [], "file": file, "line": 1} for file in files)
    began = {"tree": {**first, "children": [other]}, "run": {"parameters": {"map": files[0]}}}
    (entry,) = PathShortener(Path("/var/journals")).shorten_stream(
        [JournalEntry(1, 1, 0.0, 0.0, "run_began", began)]
    )
    tree = entry.data["tree"]
    assert [tree["file"], tree["children"][0]["file"]] == told
    assert entry.data["run"]["parameters"]["map"] == told[0]

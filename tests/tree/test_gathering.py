"""Which files in folders are tree files."""

import os
from pathlib import Path

import pytest

from sar_compiler.opener import UnreadableFileError
from sar_compiler.tree.discovery import is_tree_file, matching_files, tree_files_in

TREE = '<root BTCPP_format="4"><BehaviorTree ID="A"><AlwaysSuccess/></BehaviorTree></root>'


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def write(path, text=TREE, encoding="utf-8"):
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    Path(path).write_text(text, encoding=encoding)


def names(paths):
    return [path.as_posix() for path in paths]


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.xml", TREE),
        ("a.XML", TREE),
        ("a.xml", f'<?xml version="1.0"?>\n<!-- a > b -->\n{TREE}'),
        ("a.xml", "<root><BehaviorTree/></root>"),
        ("a.xml", '<root main_tree_to_execute="A"/>'),
        ("a.xml", "<BehaviorTree ID='A'/>"),
        ("a.xml", '<rot BTCPP_format="4"/>'),
        ("a.xml", '<root BTCPP_format="4"><Behav'),
        ("a.xml", f"// clang-format off\n{TREE}"),
        ("a.xml", f"<!DOCTYPE root>{TREE}"),
        ("a.yaml", "# A tree.\nroot:\n  children: [{BehaviorTree: {}}]\n"),
        ("a.yml", "---\n'root':\n  BTCPP_format: 4\n  children:\n    - TreeNodesModel:\n"),
        ("a.yaml", "{root: {children: [{BehaviorTree: {}}]}}"),
    ],
)
def test_a_tree_file_is_told_by_its_ending_and_its_root(name, text):
    write(name, text)
    assert is_tree_file(Path(name))


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.txt", TREE),
        ("a.xml", "<package><name>root</name></package>"),
        ("a.xml", "<!-- <root BTCPP_format='4'> --><launch/>"),
        ("a.xml", "<root><device>BehaviorTrees</device></root>"),
        ("a.xml", ""),
        ("a.xml", "no mark-up"),
        ("a.yaml", "expect:\n  root: SUCCESS\n  BehaviorTree: A\n"),
        ("a.yaml", "root: SUCCESS\n"),
        ("a.yaml", ""),
    ],
)
def test_other_files_are_passed_over(name, text):
    write(name, text)
    assert not is_tree_file(Path(name))


@pytest.mark.parametrize("encoding", ["utf-16", "utf-8-sig"])
def test_a_byte_order_mark_does_not_matter(encoding):
    write("a.xml", TREE, encoding)
    assert is_tree_file(Path("a.xml"))


def test_a_folder_is_looked_into_but_for_hidden_ones_and_those_of_colcon():
    for path in ("b.xml", "trees/a.xml", "trees/deep/c.xml"):
        write(f"ws/{path}")
    for path in (".hidden/a.xml", "build/a.xml", "trees/install/a.xml", "log/a.xml", ".a.xml"):
        write(f"ws/{path}")
    assert names(tree_files_in(Path("ws"))) == ["ws/b.xml", "ws/trees/a.xml", "ws/trees/deep/c.xml"]


def test_links_that_lead_round_in_a_circle_are_not_followed_for_ever():
    write("ws/a.xml")
    Path("ws/up").symlink_to(Path("ws").resolve(), target_is_directory=True)
    Path("ws/loop.xml").symlink_to("loop.xml")
    assert names(tree_files_in(Path("ws"))) == ["ws/a.xml"]


def test_a_pipe_in_a_folder_is_passed_over():
    write("ws/a.xml")
    os.mkfifo("ws/pipe.xml")
    assert names(tree_files_in(Path("ws"))) == ["ws/a.xml"]


def test_a_folder_that_is_not_there_cannot_be_read():
    with pytest.raises(UnreadableFileError, match="cannot read nowhere: No such file"):
        tree_files_in(Path("nowhere"))


@pytest.mark.parametrize(
    ("pattern", "files"),
    [
        ("trees", ["trees/a.xml", "trees/deep/c.xml"]),
        ("trees/*.xml", ["trees/a.xml"]),
        ("trees/**/*.xml", ["trees/a.xml", "trees/deep/c.xml"]),
        ("tre*", ["trees/a.xml", "trees/deep/c.xml"]),
        ("trees/other.xml", ["trees/other.xml"]),
        ("gone.xml", ["gone.xml"]),
        ("gone*.xml", []),
    ],
)
def test_a_path_may_be_a_file_a_folder_or_a_pattern(pattern, files):
    for path in ("trees/a.xml", "trees/deep/c.xml"):
        write(path)
    write("trees/other.xml", "<package/>")
    assert names(matching_files(Path(), pattern)) == files

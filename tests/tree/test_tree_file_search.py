"""Tests of finding tree files in folders."""

import os
from pathlib import Path

import pytest

from sar_compiler.opener import UnreadableFileError
from sar_compiler.tree.discovery import is_tree_file, matching_files, tree_files_in

TREE = '<root BTCPP_format="4"><BehaviorTree ID="A"><AlwaysSuccess/></BehaviorTree></root>'


@pytest.fixture(autouse=True)
def change_to_tmp_path(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def write(path, text=TREE, encoding="utf-8"):
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    Path(path).write_text(text, encoding=encoding)


def posix_paths(paths):
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
def test_tree_file_is_recognised_by_suffix_and_root(name, text):
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
def test_other_files_are_ignored(name, text):
    write(name, text)
    assert not is_tree_file(Path(name))


@pytest.mark.parametrize("encoding", ["utf-16", "utf-8-sig"])
def test_byte_order_mark_is_ignored(encoding):
    write("a.xml", TREE, encoding)
    assert is_tree_file(Path("a.xml"))


def test_folders_are_searched_except_hidden_and_colcon_folders():
    for path in ("b.xml", "trees/a.xml", "trees/deep/c.xml"):
        write(f"ws/{path}")
    for path in (".hidden/a.xml", "build/a.xml", "trees/install/a.xml", "log/a.xml", ".a.xml"):
        write(f"ws/{path}")
    assert posix_paths(tree_files_in(Path("ws"))) == ["ws/b.xml", "ws/trees/a.xml", "ws/trees/deep/c.xml"]


def test_cyclic_symlinks_are_not_followed():
    write("ws/a.xml")
    Path("ws/up").symlink_to(Path("ws").resolve(), target_is_directory=True)
    Path("ws/loop.xml").symlink_to("loop.xml")
    assert posix_paths(tree_files_in(Path("ws"))) == ["ws/a.xml"]


def test_pipe_in_folder_is_ignored():
    write("ws/a.xml")
    os.mkfifo("ws/pipe.xml")
    assert posix_paths(tree_files_in(Path("ws"))) == ["ws/a.xml"]


def test_missing_folder_raises_error():
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
def test_path_can_be_file_folder_or_pattern(pattern, files):
    for path in ("trees/a.xml", "trees/deep/c.xml"):
        write(path)
    write("trees/other.xml", "<package/>")
    assert posix_paths(matching_files(Path(), pattern)) == files

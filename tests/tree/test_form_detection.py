"""Tests of the detection of a file's form."""

import os

import pytest

from sar_compiler.opener import UnreadableFileError
from sar_compiler.tree.diagnostic import Form
from sar_compiler.tree.discovery import read_tree_file

XML = "<root/>"
YAML = "root:\n"


@pytest.mark.parametrize(
    ("name", "content", "form"),
    [
        ("tree.xml", XML, Form.XML),
        ("tree.XML", XML, Form.XML),
        ("tree.yaml", YAML, Form.YAML),
        ("tree.yml", YAML, Form.YAML),
        ("tree", "\n  <root/>", Form.XML),
        ("tree.txt", YAML, Form.YAML),
    ],
)
def test_form_follows_suffix_or_else_first_character(tmp_path, name, content, form):
    path = tmp_path / name
    path.write_text(content, encoding="utf-8")
    tree_file = read_tree_file(path)
    assert (tree_file.source.form, tree_file.root.tag) == (form, "root")


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_byte_order_mark_does_not_hide_first_character(tmp_path, encoding):
    path = tmp_path / "tree"
    path.write_text(XML, encoding=encoding)
    assert read_tree_file(path).source.form is Form.XML


def test_named_pipe_is_rejected_without_blocking(tmp_path):
    os.mkfifo(tmp_path / "tree.xml")
    with pytest.raises(UnreadableFileError, match=r"tree\.xml: it is a pipe, not a file"):
        read_tree_file(tmp_path / "tree.xml")


def test_shell_pipe_is_read():
    end, start = os.pipe()
    os.write(start, XML.encode())
    os.close(start)
    assert read_tree_file(f"/dev/fd/{end}").root.tag == "root"
    os.close(end)

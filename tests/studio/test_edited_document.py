"""Tests of the file that the graphical editor reads and writes."""

from pathlib import Path
from typing import Any

import pytest

from sar_compiler.opener import UnreadableFileError
from sar_compiler.studio.edited_document import EditedDocument
from sar_compiler.studio.tree_studio import Studio
from tests.faults.test_hostile_files import NO_FILES
from tests.trees import document

TREE = document("<AlwaysSuccess/>")


@pytest.fixture
def path(tmp_path):
    """Return the path of a tree file."""
    path = tmp_path / "tree.xml"
    path.write_text(TREE)
    return path


@pytest.mark.parametrize("kind", NO_FILES)
def test_pipe_or_device_in_place_of_the_file_is_not_read(path, kind):
    make, message = NO_FILES[kind]
    edited = EditedDocument(path)
    version = str(edited.load()["version"])
    path.unlink()
    make(str(path))
    for read in (
        edited.load,
        lambda: edited.is_changed(version),
        lambda: edited.save_text("<root/>", version),
    ):
        with pytest.raises(UnreadableFileError, match=message):
            read()


@pytest.mark.parametrize("kind", NO_FILES)
def test_unreadable_included_file_is_a_finding(path, kind):
    make, message = NO_FILES[kind]
    make(str(path.with_name("part.xml")))
    text = TREE.replace("<BehaviorTree", '<include path="part.xml"/><BehaviorTree', 1)
    answer: Any = Studio(path).answer_question("look", {"text": text})
    [found] = answer["findings"]
    # A link to a device points outside the folder, which is refused first.
    assert found["code"] == "include-outside" if kind == "a device" else message in found["message"]


def test_changed_file_is_overwritten_only_on_request(path):
    edited = EditedDocument(path)
    version = str(edited.load()["version"])
    path.write_text(f"{TREE}\n")
    assert edited.save_text("<root/>", version) == {"has_changed": True}
    assert path.read_text() == f"{TREE}\n"
    edited.save_text("<root/>", version, overwrite=True)
    assert path.read_text() == "<root/>"


def test_crlf_line_ends_are_preserved(path):
    path.write_bytes(TREE.replace("\n", "\r\n").encode())
    edited = EditedDocument(path)
    loaded = edited.load()
    assert "\r" not in str(loaded["text"])
    edited.save_text(str(loaded["text"]), str(loaded["version"]))
    assert path.read_bytes() == TREE.replace("\n", "\r\n").encode()


def test_saving_leaves_no_temporary_file(path):
    edited = EditedDocument(path)
    edited.save_text(TREE, str(edited.load()["version"]))
    assert list(Path(path.parent).iterdir()) == [path]

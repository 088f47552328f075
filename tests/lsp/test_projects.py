"""Tests of findings that depend on other files: unsaved files, included files, files of the same project."""

import pytest
from lsprotocol import types as lsp

from tests.cli.test_missing_libraries import run_without
from tests.lsp.editor import Editor
from tests.lsp.test_same_as_validate import shown, validated
from tests.project.random_repositories import Repository
from tests.random_inputs import rounds
from tests.trees import write

USING = ['<include path="lib.xml"/>', '<BehaviorTree ID="Main">', '<SubTree ID="Part"/>', "</BehaviorTree>"]
PART = '<BehaviorTree ID="Part">\n<Success/>\n</BehaviorTree>'


def codes(published):
    return [each.code for each in published.diagnostics]


def wait_for_codes(editor, path, *wanted):
    """Wait until the last findings of a file have given codes."""

    def has_codes():
        mine = [each for each in editor.published if each.uri == path.as_uri()]
        return bool(mine) and codes(mine[-1]) == [*wanted]

    editor.wait_until(has_codes, f"{path} never shows {wanted}")


@pytest.fixture
def project(tmp_path):
    main, library = tmp_path / "main.xml", tmp_path / "lib.xml"
    write(main, *USING, main="Main")
    write(library, PART)
    return main, library


def test_unsaved_change_of_included_file_takes_effect(editor, project):
    main, library = project
    assert codes(editor.open(main)) == []
    text = library.read_text(encoding="utf-8")
    editor.open(library)
    editor.replace(library, 2, text.replace('"Part"', '"Piece"'))
    wait_for_codes(editor, main, "unknown-tree")
    editor.replace(library, 3, text)
    wait_for_codes(editor, main)


def test_finding_in_included_file_is_shown_there(editor, project):
    main, library = project
    write(library, PART.replace("<Success/>", "<Sucess/>"))
    editor.open(main)
    wait_for_codes(editor, library, "unknown-node")


def test_tree_of_project_set_is_found_and_reported_missing_after_rename(editor, project):
    main, library = project
    write(main, *USING[1:], main="Main")
    (main.parent / "sar.toml").write_text('[project]\ntrees = ["*.xml"]\n', encoding="utf-8")
    assert codes(editor.open(main)) == []
    editor.open(library, library.read_text(encoding="utf-8").replace('"Part"', '"Piece"'))
    wait_for_codes(editor, main, "unknown-tree")


def test_configuration_error_is_shown_in_configuration_file(editor, project):
    main, _ = project
    settings = main.parent / "sar.toml"
    settings.write_text("[project\n", encoding="utf-8")
    editor.open(main)
    wait_for_codes(editor, settings, "malformed-toml")


OTHERS = {
    "package.xml": "<package format='3'>\n<name>a</name>\n</package>\n",
    "compose.yaml": "services:\n  robot:\n    image: ros\n",
}


@pytest.mark.parametrize("name", OTHERS)
def test_other_kind_of_file_is_ignored_until_it_becomes_a_tree(name, editor, tmp_path):
    path = tmp_path / name
    path.write_text(OTHERS[name], encoding="utf-8")
    assert codes(editor.open(path)) == []
    whose, start = lsp.TextDocumentIdentifier(path.as_uri()), lsp.Position(1, 0)
    form = lsp.FormattingOptions(2, insert_spaces=True)
    ask = editor.client
    assert not editor.ask(ask.text_document_completion_async(lsp.CompletionParams(whose, start)))
    assert not editor.ask(ask.text_document_formatting_async(lsp.DocumentFormattingParams(whose, form)))
    text = "root:\n  children: 1\n" if name.endswith("yaml") else '<root BTCPP_format="4"/>\n'
    assert codes(editor.replace(path, 2, text)[-1]) != []
    assert codes(editor.replace(path, 3, OTHERS[name])[-1]) != []


def test_failing_tick_is_shown_while_editor_is_idle(editor, tmp_path):
    path = tmp_path / "tree.xml"
    body = (
        '<Sequence>\n<Script code="goal := \'home\'"/>\n<ScriptCondition code="goal * 2 == 6"/>\n</Sequence>'
    )
    write(path, '<BehaviorTree ID="Main">', body, "</BehaviorTree>", main="Main")
    editor.open(path)
    wait_for_codes(editor, path, "failing-tick")


TALKING = """
import sys
from pathlib import Path
import py_trees
from sar_compiler.leaves import register
print("a leaf that talks", flush=True)
Path("talking.txt").write_text(str(sys.stdout.fileno()))

@register
class IsTalked(py_trees.behaviour.Behaviour):
    def update(self):
        return py_trees.common.Status.SUCCESS
"""


def test_custom_leaves_are_known_and_their_output_does_not_break_protocol(tmp_path, monkeypatch):
    (tmp_path / "talking.py").write_text(TALKING, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "tree.xml"
    write(path, '<BehaviorTree ID="Main">', "<IsTalked/>", "</BehaviorTree>", main="Main")
    editor = Editor("--nodes", "talking")
    assert codes(editor.open(path)) == []
    assert (tmp_path / "talking.txt").read_text(encoding="utf-8") == "2", "it talks into the conversation"
    editor.close()


def test_import_error_of_leaves_is_shown(tmp_path):
    path = tmp_path / "tree.xml"
    write(path, '<BehaviorTree ID="Main">', "<Success/>", "</BehaviorTree>", main="Main")
    editor = Editor("--nodes", "nowhere_to_be_found")
    editor.open(path)
    editor.wait_until(lambda: editor.messages, "nothing is said of the module")
    assert "'nowhere_to_be_found' (--nodes) cannot be imported" in editor.messages[0].message
    editor.close()


def test_command_without_extra_names_it():
    status, said = run_without("pygls", "sar_compiler.cli.compile:main", "lsp")
    assert status == 2
    assert "the language server needs a library that is missing" in said
    assert "pip install 'sar_compiler[lsp]'" in said


@pytest.mark.parametrize("seed", range(rounds(20)))
def test_editor_shows_findings_of_validate_in_random_repository(editor, seed, tmp_path, capsys):
    for path in Repository(tmp_path / "repository", seed).trees:
        published = editor.open(path)
        editor.close_file(path)
        assert shown(published) == validated(path, capsys), path


def test_nearby_palette_is_named_in_log(editor, project):
    main, _ = project
    nodes = main.parent / "nodes.xml"
    write(main, '<BehaviorTree ID="Main">', "<Fly/>", "</BehaviorTree>")
    write(nodes, '<TreeNodesModel><Action ID="Fly"/></TreeNodesModel>')
    assert codes(editor.open(main)) == []
    wanted = f"nodes are described by {nodes}"
    editor.wait_until(lambda: any(each.message == wanted for each in editor.logged), "no palette is named")


def test_changed_file_that_is_not_open_is_read_again(editor, project):
    main, library = project
    write(main, *USING[1:], main="Main")
    assert codes(editor.open(main)) == []
    write(library, PART.replace('"Part"', '"Piece"'))
    editor.replace(main, 2, main.read_text(encoding="utf-8") + "\n")
    wait_for_codes(editor, main, "unknown-tree")
    library.unlink()
    library.mkdir()
    editor.replace(main, 3, main.read_text(encoding="utf-8"))
    wait_for_codes(editor, main, "unknown-tree")


def test_open_folder_is_project_of_files_without_repository(tmp_path):
    path = tmp_path / "trees" / "main.xml"
    write(path, '<BehaviorTree ID="Main">', "<Fly/>", "</BehaviorTree>")
    write(tmp_path / "models" / "nodes.xml", '<TreeNodesModel><Action ID="Fly"/></TreeNodesModel>')
    editor = Editor(folder=tmp_path)
    assert codes(editor.open(path)) == []
    editor.close()

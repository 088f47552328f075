"""What an editor shows depends on the files around: unsaved, included, of the same project."""

import pytest
from lsprotocol import types as lsp

from tests.chance import rounds
from tests.cli.test_what_is_not_installed import run_without
from tests.lsp.editor import Editor
from tests.lsp.test_same_as_validate import shown, validated
from tests.project.random_repositories import Repository
from tests.trees import write

USING = ['<include path="lib.xml"/>', '<BehaviorTree ID="Main">', '<SubTree ID="Part"/>', "</BehaviorTree>"]
PART = '<BehaviorTree ID="Part">\n<Success/>\n</BehaviorTree>'


def codes(published):
    return [each.code for each in published.diagnostics]


def wait_for_codes(editor, path, *wanted):
    """Wait until the last that was published about a file has some codes."""

    def is_so():
        mine = [each for each in editor.published if each.uri == path.as_uri()]
        return bool(mine) and codes(mine[-1]) == [*wanted]

    editor.wait_until(is_so, f"{path} never shows {wanted}")


@pytest.fixture
def project(tmp_path):
    main, library = tmp_path / "main.xml", tmp_path / "lib.xml"
    write(main, *USING, main="Main")
    write(library, PART)
    return main, library


def test_an_included_file_counts_as_it_is_typed(editor, project):
    main, library = project
    assert codes(editor.open(main)) == []
    text = library.read_text(encoding="utf-8")
    editor.open(library)
    editor.replace(library, 2, text.replace('"Part"', '"Piece"'))
    wait_for_codes(editor, main, "unknown-tree")
    editor.replace(library, 3, text)
    wait_for_codes(editor, main)


def test_what_is_wrong_in_an_included_file_is_shown_there(editor, project):
    main, library = project
    write(library, PART.replace("<Success/>", "<Sucess/>"))
    editor.open(main)
    wait_for_codes(editor, library, "unknown-node")


def test_a_tree_of_the_projects_set_is_found_and_missed_when_it_is_renamed(editor, project):
    main, library = project
    write(main, *USING[1:], main="Main")
    (main.parent / "sar.toml").write_text('[project]\ntrees = ["*.xml"]\n', encoding="utf-8")
    assert codes(editor.open(main)) == []
    editor.open(library, library.read_text(encoding="utf-8").replace('"Part"', '"Piece"'))
    wait_for_codes(editor, main, "unknown-tree")


def test_a_mistake_in_the_configuration_is_shown_there(editor, project):
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
def test_a_file_of_another_kind_is_left_alone_until_it_is_a_tree(name, editor, tmp_path):
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


def test_what_a_tick_raises_is_shown_when_nothing_is_typed(editor, tmp_path):
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


def test_leaves_of_ones_own_are_known_and_what_they_print_disturbs_nobody(tmp_path, monkeypatch):
    (tmp_path / "talking.py").write_text(TALKING, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "tree.xml"
    write(path, '<BehaviorTree ID="Main">', "<IsTalked/>", "</BehaviorTree>", main="Main")
    editor = Editor("--nodes", "talking")
    assert codes(editor.open(path)) == []
    assert (tmp_path / "talking.txt").read_text(encoding="utf-8") == "2", "it talks into the conversation"
    editor.close()


def test_leaves_that_cannot_be_imported_are_told_of(tmp_path):
    path = tmp_path / "tree.xml"
    write(path, '<BehaviorTree ID="Main">', "<Success/>", "</BehaviorTree>", main="Main")
    editor = Editor("--nodes", "nowhere_to_be_found")
    editor.open(path)
    editor.wait_until(lambda: editor.messages, "nothing is said of the module")
    assert "'nowhere_to_be_found' (--nodes) cannot be imported" in editor.messages[0].message
    editor.close()


def test_without_the_extra_the_command_names_it():
    status, said = run_without("pygls", "sar_compiler.cli.compile:main", "lsp")
    assert status == 2
    assert "the language server needs a library that is missing" in said
    assert "pip install 'sar_compiler[lsp]'" in said


@pytest.mark.parametrize("seed", range(rounds(20)))
def test_an_editor_shows_what_validate_reports_whatever_is_around_a_file(editor, seed, tmp_path, capsys):
    for path in Repository(tmp_path / "repository", seed).trees:
        published = editor.open(path)
        editor.close_file(path)
        assert shown(published) == validated(path, capsys), path


def test_a_palette_around_a_file_is_named_in_the_log(editor, project):
    main, _ = project
    nodes = main.parent / "nodes.xml"
    write(main, '<BehaviorTree ID="Main">', "<Fly/>", "</BehaviorTree>")
    write(nodes, '<TreeNodesModel><Action ID="Fly"/></TreeNodesModel>')
    assert codes(editor.open(main)) == []
    wanted = f"nodes are described by {nodes}"
    editor.wait_until(lambda: any(each.message == wanted for each in editor.logged), "no palette is named")


def test_a_file_that_is_not_open_is_read_again_when_it_has_changed(editor, project):
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


def test_the_folder_that_is_open_is_the_project_of_files_without_a_repository(tmp_path):
    path = tmp_path / "trees" / "main.xml"
    write(path, '<BehaviorTree ID="Main">', "<Fly/>", "</BehaviorTree>")
    write(tmp_path / "models" / "nodes.xml", '<TreeNodesModel><Action ID="Fly"/></TreeNodesModel>')
    editor = Editor(folder=tmp_path)
    assert codes(editor.open(path)) == []
    editor.close()

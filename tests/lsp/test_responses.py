"""Tests of the language server's responses: completion, hover, rename, fixes, lenses."""

import pytest
from lsprotocol import types as lsp
from pygls.exceptions import JsonRpcException

from tests.trees import write

MAIN = [
    '<include path="lib.xml"/>',
    '<BehaviorTree ID="Main">',
    '<Sequence memroy="true">',
    '<SubTree ID="Part" in="{found}"/>',
    '<SetBlackboard value="1" output_key="found"/>',
    '<Sleep msec="{found}" />',
    "</Sequence>",
    "</BehaviorTree>",
]
LIBRARY = [
    '<BehaviorTree ID="Part">',
    '<Sleep msec="{in}"/>',
    "</BehaviorTree>",
]


@pytest.fixture
def files(editor, tmp_path):
    main, library = tmp_path / "main.xml", tmp_path / "lib.xml"
    write(main, *MAIN, main="Main")
    write(library, *LIBRARY)
    editor.open(main)
    return main, library


def document_id(path):
    return lsp.TextDocumentIdentifier(path.as_uri())


def position_of(path, word, after=0):
    """Return the position of a word in a file."""
    text = path.read_text(encoding="utf-8")
    before = text[: text.index(word) + after]
    return lsp.Position(before.count("\n"), len(before) - before.rfind("\n") - 1)


def completions(editor, path, place):
    answer = editor.ask(
        editor.client.text_document_completion_async(lsp.CompletionParams(document_id(path), place))
    )
    return {each.label for each in answer}


def offered_in(editor, path, before, behind=""):
    """Return the completions after an incomplete text."""
    editor.open(path, before + behind)
    lines = before.split("\n")
    return completions(editor, path, lsp.Position(len(lines) - 1, len(lines[-1])))


HEAD = '<root BTCPP_format="4">\n<BehaviorTree ID="Main">\n'


def test_completion_offers_nodes_and_ports_of_nearby_palette(editor, tmp_path):
    model = '<Action ID="Wave"><input_port name="hand"/></Action>'
    (tmp_path / ".git").mkdir()
    (tmp_path / "trees").mkdir()
    write(tmp_path / "nodes.xml", f"<TreeNodesModel>{model}</TreeNodesModel>")
    path = tmp_path / "trees" / "tree.xml"
    assert "Wave" in offered_in(editor, path, f"{HEAD}<Wa")
    editor.close_file(path)
    assert "hand" in offered_in(editor, path, f"{HEAD}<Wave ")


@pytest.mark.parametrize(
    ("typed", "wanted", "others"),
    [
        ("<", {"Sequence", "Sleep", "SubTree"}, {"msec"}),
        ("<Sl", {"Sleep"}, {"msec"}),
        ("<Sleep ", {"msec", "_skipIf"}, {"Sequence", "policy"}),
        ('<Sleep msec="10" na', {"name"}, {"Sequence"}),
        ('<Parallel policy="', {"SuccessOnAll", "SuccessOnOne"}, {"msec"}),
        ('<Sleep oneshot="', {"ON_COMPLETION"}, {"true"}),
        ("<Sleep/> ", set(), {"msec", "Sleep"}),
    ],
)
def test_completion_offers_valid_items_in_xml(typed, wanted, others, editor, tmp_path):
    found = offered_in(editor, tmp_path / "tree.xml", HEAD + typed, "\n</BehaviorTree>\n</root>\n")
    assert wanted - found == set()
    assert others & found == set()


YAML = "root:\n  children:\n  - BehaviorTree:\n      ID: Main\n      children:\n"


@pytest.mark.parametrize(
    ("typed", "wanted", "others"),
    [
        ("      - ", {"Sequence", "Sleep"}, {"msec"}),
        ("      - Sleep:\n          ", {"msec"}, {"Sequence"}),
        ("      - Parallel:\n          policy: ", {"SuccessOnAll"}, {"msec"}),
        ("      - Sleep: {ms", {"msec"}, {"Sequence"}),
        ("      - Parallel: {policy: ", {"SuccessOnAll"}, {"msec"}),
    ],
)
def test_completion_offers_valid_items_in_yaml(typed, wanted, others, editor, tmp_path):
    found = offered_in(editor, tmp_path / "tree.yaml", YAML + typed)
    assert wanted - found == set()
    assert others & found == set()


def test_completion_offers_trees_of_included_files_and_keys(editor, files):
    main, _ = files
    assert {"Part", "Main"} <= completions(editor, main, position_of(main, 'ID="Part"', 4))
    assert "found" in completions(editor, main, position_of(main, "{found}", 1))


def test_hover_shows_ports_and_outcomes_of_node(editor, files):
    main, _ = files
    answer = editor.ask(
        editor.client.text_document_hover_async(
            lsp.HoverParams(document_id(main), position_of(main, "Sleep"))
        )
    )
    assert "msec: input" in answer.contents.value
    assert "outcomes: RUNNING, SUCCESS" in answer.contents.value


def locations(answer, *paths):
    names = {path.as_uri(): path.stem for path in paths}
    return sorted((names[each.uri], each.range.start.line, each.range.start.character) for each in answer)


def definitions_of(editor, path, place):
    return editor.ask(
        editor.client.text_document_definition_async(lsp.DefinitionParams(document_id(path), place))
    )


def references_to(editor, path, place):
    context = lsp.ReferenceContext(include_declaration=True)
    question = lsp.ReferenceParams(context, document_id(path), place)
    return editor.ask(editor.client.text_document_references_async(question))


def test_subtree_leads_to_its_tree_in_included_file(editor, files):
    main, library = files
    assert locations(definitions_of(editor, main, position_of(main, 'ID="Part"', 5)), main, library) == [
        ("lib", 1, 18)
    ]
    assert locations(references_to(editor, main, position_of(main, "SubTree")), main, library) == [
        ("lib", 1, 18),
        ("main", 4, 13),
    ]


def test_key_leads_to_its_writers_and_readers(editor, files):
    main, library = files
    place = position_of(main, 'msec="{found}', 8)
    assert locations(definitions_of(editor, main, place), main, library) == [("main", 5, 37)]
    assert locations(references_to(editor, main, place), main, library) == [
        ("main", 4, 24),
        ("main", 5, 37),
        ("main", 6, 14),
    ]


def texts_after_rename(editor, path, place, name):
    """Return the texts of the files after a rename."""
    answer = editor.ask(
        editor.client.text_document_rename_async(lsp.RenameParams(document_id(path), place, name))
    )
    texts = {}
    for each in path.parent.glob("*.xml"):
        lines = each.read_text(encoding="utf-8").split("\n")
        edits = answer.changes.get(each.as_uri(), [])
        for edit in sorted(edits, key=lambda one: one.range.start.character, reverse=True):
            first, last = edit.range.start, edit.range.end
            line = lines[first.line]
            lines[first.line] = line[: first.character] + edit.new_text + line[last.character :]
        texts[each.stem] = "\n".join(lines)
    return texts


def test_tree_is_renamed_in_all_files(editor, files):
    main, library = files
    texts = texts_after_rename(editor, main, position_of(main, 'ID="Part"', 5), "Piece")
    assert texts["main"] == main.read_text(encoding="utf-8").replace('"Part"', '"Piece"')
    assert texts["lib"] == library.read_text(encoding="utf-8").replace('"Part"', '"Piece"')


def test_key_is_renamed_in_writers_readers_and_remappings(editor, files):
    main, _ = files
    texts = texts_after_rename(editor, main, position_of(main, "{found}", 2), "seen")
    assert texts["main"] == main.read_text(encoding="utf-8").replace("found", "seen")


def test_key_in_yaml_of_leaf_is_renamed_but_not_field_of_same_name(editor, tmp_path):
    main = tmp_path / "main.xml"
    (tmp_path / "sar.toml").write_text('models = ["ros:jazzy"]\n', encoding="utf-8")
    topic = '<RosTopic topic="a" type="geometry_msgs/msg/Point" fields="x: {x}, y: { y }"/>'
    publish = '<RosPublish topic="b" type="geometry_msgs/msg/Point" message="x: {y}, y: {x}, z: {x}"/>'
    write(main, '<BehaviorTree ID="Main">', "<Sequence>", topic, publish, "</Sequence>", "</BehaviorTree>")
    editor.open(main)
    texts = texts_after_rename(editor, main, position_of(main, "{x}", 1), "east")
    assert texts["main"] == main.read_text(encoding="utf-8").replace("{x}", "{east}")
    texts = texts_after_rename(editor, main, position_of(main, "{ y }", 2), "north")
    assert texts["main"] == main.read_text(encoding="utf-8").replace("{ y }", "{ north }").replace(
        "{y}", "{north}"
    )


def test_subtree_port_is_renamed_in_uses_of_the_tree(editor, files):
    main, library = files
    editor.open(library)
    texts = texts_after_rename(editor, library, position_of(library, "{in}", 2), "way")
    assert texts["lib"] == library.read_text(encoding="utf-8").replace("{in}", "{way}")
    assert texts["main"] == main.read_text(encoding="utf-8").replace(' in="', ' way="')


def name_to_change(editor, path, place):
    """Return the name that can be changed, and its range; None if there is none."""
    question = lsp.PrepareRenameParams(document_id(path), place)
    return editor.ask(editor.client.text_document_prepare_rename_async(question))


def test_only_the_name_is_offered_for_renaming(editor, files):
    main, _ = files
    place = position_of(main, 'ID="Part"', 5)
    offered = name_to_change(editor, main, place)
    start = lsp.Position(place.line, place.character - 1)
    assert offered.placeholder == "Part"
    assert offered.range == lsp.Range(start, lsp.Position(place.line, start.character + len("Part")))


def test_tag_cannot_be_renamed(editor, files):
    main, _ = files
    assert name_to_change(editor, main, position_of(main, "<SubTree", 2)) is None


def test_shared_root_key_is_not_offered_for_renaming(editor, tmp_path):
    path = tmp_path / "tree.xml"
    write(path, '<BehaviorTree ID="Main">', '<Script code="@k := 1; @k = 2"/>', "</BehaviorTree>")
    editor.open(path)
    with pytest.raises(
        JsonRpcException, match="cannot be renamed: a key of the root can be used by all trees"
    ):
        name_to_change(editor, path, position_of(path, "@k", 1))


def test_shared_root_key_is_not_renamed(editor, tmp_path):
    path = tmp_path / "tree.xml"
    write(path, '<BehaviorTree ID="Main">', '<Script code="@k := 1; @k = 2"/>', "</BehaviorTree>")
    editor.open(path)
    with pytest.raises(
        JsonRpcException, match="cannot be renamed: a key of the root can be used by all trees"
    ):
        texts_after_rename(editor, path, position_of(path, "@k", 1), "other")


@pytest.mark.parametrize(
    ("word", "after", "name", "why"),
    [
        ("{found}", 2, "found-it", "is not a valid name. Use only letters, digits and '_'"),
        ("{found}", 2, "other", "'other' already exists"),
        ('ID="Part"', 5, "Main", "'Main' already exists"),
        ('ID="Part"', 5, "a part", "is not a valid name"),
    ],
)
def test_invalid_or_existing_name_is_refused(word, after, name, why, editor, files):
    main, _ = files
    text = main.read_text(encoding="utf-8")
    other = '<SetBlackboard value="1" output_key="other"/>\n</Sequence>'
    main.write_text(text.replace("</Sequence>", other), encoding="utf-8")
    editor.open(main)
    with pytest.raises(JsonRpcException, match=why):
        texts_after_rename(editor, main, position_of(main, word, after), name)


def test_finding_offers_its_suggested_fix(editor, files):
    main, _ = files
    place = position_of(main, "memroy")
    context = lsp.CodeActionContext([])
    question = lsp.CodeActionParams(document_id(main), lsp.Range(place, place), context)
    answer = editor.ask(editor.client.text_document_code_action_async(question))
    fixes = [each for each in answer if each.edit]
    written = {each.title: each.edit.changes[main.as_uri()][0].new_text for each in fixes}
    assert written == {"Replace by memory": "memory", "Apply all safe fixes": "memory"}


def test_refactoring_is_offered_and_its_edit_is_resolved_on_choice(editor, files):
    main, _ = files
    place = position_of(main, "Sequence")
    question = lsp.CodeActionParams(document_id(main), lsp.Range(place, place), lsp.CodeActionContext([]))
    offered = {
        each.title: each for each in editor.ask(editor.client.text_document_code_action_async(question))
    }
    chosen = editor.ask(editor.client.code_action_resolve_async(offered["Extract to a subtree"]))
    assert chosen.kind == lsp.CodeActionKind.RefactorExtract
    written = "".join(each.new_text for each in chosen.edit.changes[main.as_uri()])
    assert '<BehaviorTree ID="Sequence">' in written


def test_fix_of_tag_also_replaces_its_end_tag(editor, files):
    main, _ = files
    right = main.read_text(encoding="utf-8")
    wrong = right.replace("Sequence", "Sequnce")
    main.write_text(wrong, encoding="utf-8")
    editor.open(main)
    place = position_of(main, "<Sequnce", 1)
    question = lsp.CodeActionParams(document_id(main), lsp.Range(place, place), lsp.CodeActionContext([]))
    answer = editor.ask(editor.client.text_document_code_action_async(question))
    (edit,) = next(each for each in answer if each.title == "Replace by Sequence").edit.changes[main.as_uri()]
    lines = wrong.splitlines(keepends=True)
    start, end = (
        sum(map(len, lines[: each.line])) + each.character for each in (edit.range.start, edit.range.end)
    )
    assert f"{wrong[:start]}{edit.new_text}{wrong[end:]}" == right


def test_formatting_writes_canonical_form(editor, files):
    main, _ = files
    options = lsp.FormattingOptions(tab_size=2, insert_spaces=True)
    question = lsp.DocumentFormattingParams(document_id(main), options)
    (edit,) = editor.ask(editor.client.text_document_formatting_async(question))
    assert '\n    <Sequence memroy="true">\n' in edit.new_text


def test_document_symbols_are_trees_and_nodes(editor, files):
    main, _ = files
    question = lsp.DocumentSymbolParams(document_id(main))
    (tree,) = editor.ask(editor.client.text_document_document_symbol_async(question))
    assert (tree.name, [each.name for each in tree.children[0].children]) == (
        "Main",
        ["Part", "SetBlackboard", "Sleep"],
    )


def test_lenses_verify_and_simulate_unsaved_tree(editor, tmp_path):
    path = tmp_path / "tree.xml"
    write(path, '<BehaviorTree ID="Main">', "<Failure/>", "</BehaviorTree>", main="Main")
    editor.open(path, path.read_text(encoding="utf-8").replace("Failure", "Success"))
    lenses = editor.ask(editor.client.text_document_code_lens_async(lsp.CodeLensParams(document_id(path))))
    assert [each.command.title for each in lenses] == ["verify", "simulate"]
    for each in lenses:
        question = lsp.ExecuteCommandParams(each.command.command, each.command.arguments)
        assert editor.ask(editor.client.workspace_execute_command_async(question)) is True
    assert "every run ends:" in editor.logged[-2].message
    assert "root SUCCESS" in editor.logged[-1].message


def test_lens_applies_to_the_tree_below_it(editor, tmp_path):
    path = tmp_path / "tree.xml"
    trees = ('<BehaviorTree ID="Main">', "<Success/>", "</BehaviorTree>")
    other = ('<BehaviorTree ID="Other">', "<Failure/>", "</BehaviorTree>")
    write(path, *trees, *other)
    editor.open(path)
    lenses = editor.ask(editor.client.text_document_code_lens_async(lsp.CodeLensParams(document_id(path))))
    (chosen,) = (
        each.command
        for each in lenses
        if (each.command.title, each.command.arguments[1]) == ("simulate", "Other")
    )
    question = lsp.ExecuteCommandParams(chosen.command, chosen.arguments)
    editor.ask(editor.client.workspace_execute_command_async(question))
    assert "root FAILURE" in editor.logged[-1].message

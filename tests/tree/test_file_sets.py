"""Tests of file sets: where a missing tree is searched for, and which files are not read."""

from pathlib import Path

import pytest

from sar_compiler.checks import check
from sar_compiler.nodes.registry import default_registry
from sar_compiler.tree.discovery import read_tree_file
from sar_compiler.tree.forest import TreeSet, load_forest
from tests.trees import write

A, B, C = (f'<BehaviorTree ID="{name}"><AlwaysSuccess/></BehaviorTree>' for name in "ABC")
OTHER_B = B.replace("Success", "Failure")


@pytest.fixture(autouse=True)
def change_to_tmp_path(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def tree_using(name, *used):
    uses = "".join(f'<SubTree ID="{each}"/>' for each in used)
    return f'<BehaviorTree ID="{name}"><Sequence><AlwaysSuccess/>{uses}</Sequence></BehaviorTree>'


def set_of(*paths, read=read_tree_file):
    return TreeSet(lambda: map(Path, paths), read)


def load(path, tree_set):
    return load_forest(Path(path), read_tree_file, (), tree_set)


def target_locations(forest):
    """Return the location of each tree that was found in the set, by its ID."""
    trees = forest.targets.values()
    return {tree.attributes["ID"]: (Path(tree.source.path).as_posix(), tree.line) for tree in trees}


def errors_in(forest):
    return [
        (each.code, Path(each.source.path).name, each.span.line, each.message)
        for each in check(forest, default_registry())
        if each.severity.value == "error"
    ]


def test_missing_tree_is_found_in_another_file():
    write("main.xml", tree_using("Main", "B"))
    write("more.xml", A, B)
    forest = load("main.xml", set_of("main.xml", "more.xml"))
    assert target_locations(forest) == {"B": ("more.xml", 3)}
    assert [each.source.path for each in forest.others] == ["more.xml"]
    assert errors_in(forest) == []


def test_set_is_not_read_while_no_tree_is_missing():
    write("main.xml", A, tree_using("Main", "A"), main="Main")

    def paths():
        pytest.fail("the files of the set were asked for")

    forest = load("main.xml", TreeSet(paths, read_tree_file))
    assert errors_in(forest) == []


def test_trees_of_file_and_its_includes_take_precedence():
    write("main.xml", '<include path="parts/own.xml"/>', C, tree_using("Main", "B", "C"))
    write("parts/own.xml", B)
    write("more.xml", OTHER_B, C)
    forest = load("main.xml", set_of("main.xml", "more.xml"))
    assert (target_locations(forest), errors_in(forest)) == ({}, [])


def test_tree_in_yaml_file_is_found():
    write("main.xml", tree_using("Main", "B"))
    Path("more.yaml").write_text(
        "root:\n  children:\n    - BehaviorTree:\n        ID: B\n        children: [AlwaysSuccess]\n",
        encoding="utf-8",
    )
    forest = load("main.xml", set_of("more.yaml"))
    assert (target_locations(forest), errors_in(forest)) == ({"B": ("more.yaml", 3)}, [])


def test_references_of_found_tree_are_searched_in_its_own_file_first():
    write("main.xml", tree_using("Main", "A"), C)
    write("one.xml", tree_using("A", "B", "C"), C)
    write("two.xml", tree_using("B", "Main"))
    forest = load("main.xml", set_of("main.xml", "one.xml", "two.xml"))
    assert target_locations(forest) == {
        "A": ("one.xml", 2),
        "B": ("two.xml", 2),
        "C": ("one.xml", 3),
        "Main": ("main.xml", 2),
    }
    assert [error[0] for error in errors_in(forest)] == ["recursive-tree"]


def test_referenced_duplicate_trees_are_reported():
    write("trees/main.xml", tree_using("Main", "B"))
    write("one/b.xml", B)
    write("two/b.xml", OTHER_B)
    ((code, file, line, message),) = errors_in(load("trees/main.xml", set_of("one/b.xml", "two/b.xml")))
    assert (code, file, line) == ("duplicate-tree-id", "main.xml", 2)
    assert message == "the tree 'B' is defined in several files of the set: one/b.xml:2 and two/b.xml:2"


def test_unreferenced_duplicate_trees_are_not_reported():
    write("trees/main.xml", tree_using("Main", "C"))
    write("one/b.xml", B, C)
    write("two/b.xml", OTHER_B)
    assert errors_in(load("trees/main.xml", set_of("one/b.xml", "two/b.xml"))) == []


def test_identical_duplicate_trees_are_not_reported():
    write("trees/main.xml", tree_using("Main", "B"))
    write("one/b.xml", B)
    write("two/b.xml", A, B)
    assert errors_in(load("trees/main.xml", set_of("one/b.xml", "two/b.xml"))) == []


def test_duplicate_tree_in_same_folder_takes_precedence():
    write("one/main.xml", tree_using("Main", "B"))
    write("one/b.xml", B)
    write("two/b.xml", OTHER_B)
    forest = load("one/main.xml", set_of("two/b.xml", "one/b.xml"))
    assert (target_locations(forest), errors_in(forest)) == ({"B": ("one/b.xml", 2)}, [])


def test_main_tree_can_be_in_another_file():
    write("main.xml", A, main="B")
    write("more.xml", B)
    forest = load("main.xml", set_of("more.xml"))
    tree = forest.main_tree()
    assert tree is not None
    assert (tree.source.path, errors_in(forest)) == ("more.xml", [])


def test_unknown_tree_is_reported_with_suggestion_from_set():
    write("main.xml", tree_using("Main", "Graps"))
    write("more.xml", B.replace('"B"', '"Grasp"'))
    (finding,) = check(load("main.xml", set_of("more.xml")), default_registry())
    assert (finding.code, finding.suggestion) == ("unknown-tree", "Grasp")


def test_malformed_file_of_set_is_reported_at_its_location():
    write("main.xml", tree_using("Main", "B"))
    Path("more.xml").write_text("<root>\n<BehaviorTree", encoding="utf-8")
    assert [error[:2] for error in errors_in(load("main.xml", set_of("more.xml")))] == [
        ("malformed-xml", "more.xml")
    ]


def test_unreadable_file_of_set_is_reported_at_tree_reference():
    write("main.xml", tree_using("Main", "B"))
    ((code, file, line, message),) = errors_in(load("main.xml", set_of("gone.xml")))
    assert (code, file, line) == ("unreadable-include", "main.xml", 2)
    assert message.endswith("cannot read gone.xml: No such file or directory")


def test_findings_in_used_tree_of_another_file_are_reported():
    write("main.xml", tree_using("Main", "B"))
    write("more.xml", B.replace("AlwaysSuccess", "AlwaysSucess"), C.replace("AlwaysSuccess", "Unused"))
    assert [error[:3] for error in errors_in(load("main.xml", set_of("more.xml")))] == [
        ("unknown-node", "more.xml", 2)
    ]


def test_comment_in_another_file_suppresses_its_findings():
    body = "\n<!-- sar: allow needless-node: for later -->\n<Sequence><AlwaysSuccess/></Sequence>"
    write("main.xml", tree_using("Main", "B"))
    write("more.xml", f'<BehaviorTree ID="B">{body}</BehaviorTree>', "<!-- sar: allow never-ends: unused -->")
    assert check(load("main.xml", set_of("more.xml")), default_registry()) == []


def test_suppression_is_needed_while_another_file_uses_tree():
    allow = "<!-- sar: allow needless-node: for later -->"
    write("more.xml", f"{allow}\n{B}")
    write("main.xml", tree_using("Main", "B"))
    assert warnings_in(load("more.xml", set_of("more.xml"))) == [("unneeded-allow", 2)]
    assert warnings_in(load("more.xml", set_of("more.xml", "main.xml"))) == []


def node_model(*ports):
    listed = "".join(f'<input_port name="{port}"/>' for port in ports)
    return f'<TreeNodesModel><Action ID="Grip">{listed}</Action></TreeNodesModel>'


def test_each_file_uses_its_own_node_models():
    write(
        "main.xml",
        tree_using("Main", "B").replace("<AlwaysSuccess/>", '<Grip hard="1"/>'),
        node_model("hard"),
    )
    write("more.xml", '<BehaviorTree ID="B"><Grip soft="1"/></BehaviorTree>', node_model("soft"))
    assert errors_in(load("main.xml", set_of("main.xml", "more.xml"))) == []
    write("more.xml", '<BehaviorTree ID="B"><Grip sofd="1"/></BehaviorTree>', node_model("soft"))
    assert [error[:2] for error in errors_in(load("main.xml", set_of("more.xml")))] == [
        ("unknown-attribute", "more.xml")
    ]


def test_model_of_subtree_applies_in_other_files():
    write("main.xml", tree_using("Main", "B"))
    model = '<TreeNodesModel><SubTree ID="B"><input_port name="zone"/></SubTree></TreeNodesModel>'
    write("more.xml", B, model)
    assert [error[:2] for error in errors_in(load("main.xml", set_of("more.xml")))] == [
        ("missing-attribute", "main.xml")
    ]


def test_models_of_other_file_describe_its_nodes():
    write("main.xml", tree_using("Main", "B"))
    model = '<TreeNodesModel><Action ID="Grip"/></TreeNodesModel>'
    write("more.xml", '<BehaviorTree ID="B"><Grip/></BehaviorTree>', model)
    assert errors_in(load("main.xml", set_of("more.xml"))) == []


def test_each_file_of_set_is_read_once():
    count, read = 30, []
    names = [f"{number}.xml" for number in range(count)]
    for number, name in enumerate(names):
        write(name, tree_using(f"T{number}", *([f"T{number + 1}"] if number + 1 < count else [])))

    def counted(path):
        read.append(path)
        return read_tree_file(path)

    tree_set = set_of(*names, read=counted)
    for name in names:
        load(name, tree_set)
    assert sorted(read) == sorted(map(Path, names))


KEY = '<BehaviorTree ID="{}"><Script code="x := y"/></BehaviorTree>'


def warnings_in(forest):
    return [(each.code, each.span.line) for each in check(forest, default_registry())]


def test_each_unused_tree_is_checked_as_possible_main_tree():
    write("main.xml", KEY.format("One"), KEY.format("Two"), tree_using("Three", "Two"))
    found = warnings_in(load("main.xml", None))
    assert [line for code, line in found if code == "unwritten-key"] == [2, 3]


def test_tree_used_by_another_file_is_not_checked_as_main_tree():
    write("main.xml", KEY.format("One"))
    write("user.xml", tree_using("Main", "One"))
    assert ("unwritten-key", 2) in warnings_in(load("main.xml", set_of("main.xml")))
    assert warnings_in(load("main.xml", set_of("main.xml", "user.xml"))) == []


def test_tree_used_only_by_another_file_is_not_unused():
    write("main.xml", A, B, main="A")
    write("user.xml", tree_using("User", "B"))
    assert warnings_in(load("main.xml", set_of("main.xml"))) == [("unused-tree", 3)]
    assert warnings_in(load("main.xml", set_of("main.xml", "user.xml"))) == []


def test_work_grows_linearly_with_set(monkeypatch):
    looked = []

    def references(tree):
        looked.append(tree)
        return tuple(each for each in tree.iterate() if each.tag == "SubTree")

    monkeypatch.setattr("sar_compiler.tree.forest._references", references)

    def effort(count):
        looked.clear()
        for number in range(count):
            write(f"s{count}/{number}.xml", tree_using(f"T{number}", "Shared"))
        write(f"s{count}/shared.xml", tree_using("Shared"))
        names = [f"s{count}/{number}.xml" for number in range(count)]
        tree_set = set_of(*names, f"s{count}/shared.xml")
        for name in names:
            load(name, tree_set)
        return len(looked)

    small, large = effort(10), effort(20)
    assert 0 < large <= 2 * small


def test_file_included_by_others_of_set_counts_once():
    write("main.xml", tree_using("Main", "B", "C"))
    write("b.xml", tree_using("B", "C"))
    write("c.xml", C)
    write("a.xml", '<include path="c.xml"/>', '<include path="b.xml"/>', A)
    forest = load("main.xml", set_of("a.xml", "b.xml", "c.xml"))
    assert (target_locations(forest), errors_in(forest)) == ({"B": ("b.xml", 2), "C": ("c.xml", 2)}, [])
    assert sorted(each.source.path for each in forest.others) == ["b.xml", "c.xml"]

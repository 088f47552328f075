"""Files that belong together: where a tree is sought that a file lacks, and what is not read for it."""

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
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def using(name, *used):
    uses = "".join(f'<SubTree ID="{each}"/>' for each in used)
    return f'<BehaviorTree ID="{name}"><Sequence><AlwaysSuccess/>{uses}</Sequence></BehaviorTree>'


def set_of(*paths, read=read_tree_file):
    return TreeSet(lambda: map(Path, paths), read)


def load(path, tree_set):
    return load_forest(Path(path), read_tree_file, (), tree_set)


def meant(forest):
    """Return the place of each tree that is found in the set, by its ID."""
    trees = forest.targets.values()
    return {tree.attributes["ID"]: (Path(tree.source.path).as_posix(), tree.line) for tree in trees}


def errors(forest):
    return [
        (each.code, Path(each.source.path).name, each.span.line, each.message)
        for each in check(forest, default_registry())
        if each.severity.value == "error"
    ]


def test_a_tree_that_a_file_lacks_is_found_in_another_one():
    write("main.xml", using("Main", "B"))
    write("more.xml", A, B)
    forest = load("main.xml", set_of("main.xml", "more.xml"))
    assert meant(forest) == {"B": ("more.xml", 3)}
    assert [each.source.path for each in forest.others] == ["more.xml"]
    assert errors(forest) == []


def test_nothing_is_read_while_no_tree_is_missing():
    write("main.xml", A, using("Main", "A"), main="Main")

    def paths():
        pytest.fail("the files of the set were asked for")

    forest = load("main.xml", TreeSet(paths, read_tree_file))
    assert errors(forest) == []


def test_trees_of_the_file_and_of_what_it_includes_come_first():
    write("main.xml", '<include path="parts/own.xml"/>', C, using("Main", "B", "C"))
    write("parts/own.xml", B)
    write("more.xml", OTHER_B, C)
    forest = load("main.xml", set_of("main.xml", "more.xml"))
    assert (meant(forest), errors(forest)) == ({}, [])


def test_a_tree_in_a_file_of_yaml_is_found_as_well():
    write("main.xml", using("Main", "B"))
    Path("more.yaml").write_text(
        "root:\n  children:\n    - BehaviorTree:\n        ID: B\n        children: [AlwaysSuccess]\n",
        encoding="utf-8",
    )
    forest = load("main.xml", set_of("more.yaml"))
    assert (meant(forest), errors(forest)) == ({"B": ("more.yaml", 3)}, [])


def test_what_a_found_tree_lacks_is_sought_further_and_first_in_its_own_file():
    write("main.xml", using("Main", "A"), C)
    write("one.xml", using("A", "B", "C"), C)
    write("two.xml", using("B", "Main"))
    forest = load("main.xml", set_of("main.xml", "one.xml", "two.xml"))
    assert meant(forest) == {
        "A": ("one.xml", 2),
        "B": ("two.xml", 2),
        "C": ("one.xml", 3),
        "Main": ("main.xml", 2),
    }
    assert [error[0] for error in errors(forest)] == ["recursive-tree"]


def test_trees_of_one_id_clash_where_one_of_them_is_meant():
    write("trees/main.xml", using("Main", "B"))
    write("one/b.xml", B)
    write("two/b.xml", OTHER_B)
    ((code, file, line, message),) = errors(load("trees/main.xml", set_of("one/b.xml", "two/b.xml")))
    assert (code, file, line) == ("duplicate-tree-id", "main.xml", 2)
    assert message == "the tree 'B' is defined in several files of the set: one/b.xml:2 and two/b.xml:2"


def test_trees_of_one_id_that_nobody_means_do_not_clash():
    write("trees/main.xml", using("Main", "C"))
    write("one/b.xml", B, C)
    write("two/b.xml", OTHER_B)
    assert errors(load("trees/main.xml", set_of("one/b.xml", "two/b.xml"))) == []


def test_trees_of_one_id_that_are_the_same_do_not_clash():
    write("trees/main.xml", using("Main", "B"))
    write("one/b.xml", B)
    write("two/b.xml", A, B)
    assert errors(load("trees/main.xml", set_of("one/b.xml", "two/b.xml"))) == []


def test_of_trees_of_one_id_the_one_in_the_folder_of_the_file_counts():
    write("one/main.xml", using("Main", "B"))
    write("one/b.xml", B)
    write("two/b.xml", OTHER_B)
    forest = load("one/main.xml", set_of("two/b.xml", "one/b.xml"))
    assert (meant(forest), errors(forest)) == ({"B": ("one/b.xml", 2)}, [])


def test_the_main_tree_may_be_in_another_file():
    write("main.xml", A, main="B")
    write("more.xml", B)
    forest = load("main.xml", set_of("more.xml"))
    tree = forest.main_tree()
    assert tree is not None
    assert (tree.source.path, errors(forest)) == ("more.xml", [])


def test_a_tree_that_is_nowhere_is_missing_and_the_names_of_the_set_are_suggested():
    write("main.xml", using("Main", "Graps"))
    write("more.xml", B.replace('"B"', '"Grasp"'))
    (finding,) = check(load("main.xml", set_of("more.xml")), default_registry())
    assert (finding.code, finding.suggestion) == ("unknown-tree", "Grasp")


def test_a_malformed_file_in_which_the_tree_may_be_is_told_in_its_place():
    write("main.xml", using("Main", "B"))
    Path("more.xml").write_text("<root>\n<BehaviorTree", encoding="utf-8")
    assert [error[:2] for error in errors(load("main.xml", set_of("more.xml")))] == [
        ("malformed-xml", "more.xml")
    ]


def test_a_file_that_cannot_be_read_and_may_have_the_tree_is_told_where_the_tree_is_named():
    write("main.xml", using("Main", "B"))
    ((code, file, line, message),) = errors(load("main.xml", set_of("gone.xml")))
    assert (code, file, line) == ("unreadable-include", "main.xml", 2)
    assert message.endswith("cannot read gone.xml: No such file or directory")


def test_findings_in_a_tree_of_another_file_come_with_the_file_that_uses_it():
    write("main.xml", using("Main", "B"))
    write("more.xml", B.replace("AlwaysSuccess", "AlwaysSucess"), C.replace("AlwaysSuccess", "Unused"))
    assert [error[:3] for error in errors(load("main.xml", set_of("more.xml")))] == [
        ("unknown-node", "more.xml", 2)
    ]


def test_a_comment_in_the_other_file_allows_what_is_found_there():
    body = "\n<!-- sar: allow needless-node: for later -->\n<Sequence><AlwaysSuccess/></Sequence>"
    write("main.xml", using("Main", "B"))
    write("more.xml", f'<BehaviorTree ID="B">{body}</BehaviorTree>', "<!-- sar: allow never-ends: unused -->")
    assert check(load("main.xml", set_of("more.xml")), default_registry()) == []


def test_a_comment_is_not_unneeded_while_another_file_uses_the_tree():
    allow = "<!-- sar: allow needless-node: for later -->"
    write("more.xml", f"{allow}\n{B}")
    write("main.xml", using("Main", "B"))
    assert warnings(load("more.xml", set_of("more.xml"))) == [("unneeded-allow", 2)]
    assert warnings(load("more.xml", set_of("more.xml", "main.xml"))) == []


def described(*ports):
    listed = "".join(f'<input_port name="{port}"/>' for port in ports)
    return f'<TreeNodesModel><Action ID="Grip">{listed}</Action></TreeNodesModel>'


def test_each_file_of_a_set_means_the_nodes_that_its_own_models_describe():
    write("main.xml", using("Main", "B").replace("<AlwaysSuccess/>", '<Grip hard="1"/>'), described("hard"))
    write("more.xml", '<BehaviorTree ID="B"><Grip soft="1"/></BehaviorTree>', described("soft"))
    assert errors(load("main.xml", set_of("main.xml", "more.xml"))) == []
    write("more.xml", '<BehaviorTree ID="B"><Grip sofd="1"/></BehaviorTree>', described("soft"))
    assert [error[:2] for error in errors(load("main.xml", set_of("more.xml")))] == [
        ("unknown-attribute", "more.xml")
    ]


def test_the_model_of_a_tree_counts_where_another_file_uses_it():
    write("main.xml", using("Main", "B"))
    model = '<TreeNodesModel><SubTree ID="B"><input_port name="zone"/></SubTree></TreeNodesModel>'
    write("more.xml", B, model)
    assert [error[:2] for error in errors(load("main.xml", set_of("more.xml")))] == [
        ("missing-attribute", "main.xml")
    ]


def test_models_of_the_other_file_describe_its_nodes():
    write("main.xml", using("Main", "B"))
    model = '<TreeNodesModel><Action ID="Grip"/></TreeNodesModel>'
    write("more.xml", '<BehaviorTree ID="B"><Grip/></BehaviorTree>', model)
    assert errors(load("main.xml", set_of("more.xml"))) == []


def test_however_many_files_seek_trees_each_file_of_the_set_is_read_once():
    count, read = 30, []
    names = [f"{number}.xml" for number in range(count)]
    for number, name in enumerate(names):
        write(name, using(f"T{number}", *([f"T{number + 1}"] if number + 1 < count else [])))

    def counted(path):
        read.append(path)
        return read_tree_file(path)

    tree_set = set_of(*names, read=counted)
    for name in names:
        load(name, tree_set)
    assert sorted(read) == sorted(map(Path, names))


KEY = '<BehaviorTree ID="{}"><Script code="x := y"/></BehaviorTree>'


def warnings(forest):
    return [(each.code, each.span.line) for each in check(forest, default_registry())]


def test_each_tree_that_no_other_uses_is_judged_as_one_that_may_be_executed():
    write("main.xml", KEY.format("One"), KEY.format("Two"), using("Three", "Two"))
    found = warnings(load("main.xml", None))
    assert [line for code, line in found if code == "unwritten-key"] == [2, 3]


def test_a_tree_that_another_file_uses_is_not():
    write("main.xml", KEY.format("One"))
    write("user.xml", using("Main", "One"))
    assert ("unwritten-key", 2) in warnings(load("main.xml", set_of("main.xml")))
    assert warnings(load("main.xml", set_of("main.xml", "user.xml"))) == []


def test_a_tree_that_only_another_file_uses_is_not_unused():
    write("main.xml", A, B, main="A")
    write("user.xml", using("User", "B"))
    assert warnings(load("main.xml", set_of("main.xml"))) == [("unused-tree", 3)]
    assert warnings(load("main.xml", set_of("main.xml", "user.xml"))) == []


def test_effort_grows_as_the_set_does(monkeypatch):
    looked = []

    def references(tree):
        looked.append(tree)
        return tuple(each for each in tree.iterate() if each.tag == "SubTree")

    monkeypatch.setattr("sar_compiler.tree.forest._references", references)

    def effort(count):
        looked.clear()
        for number in range(count):
            write(f"s{count}/{number}.xml", using(f"T{number}", "Shared"))
        write(f"s{count}/shared.xml", using("Shared"))
        names = [f"s{count}/{number}.xml" for number in range(count)]
        tree_set = set_of(*names, f"s{count}/shared.xml")
        for name in names:
            load(name, tree_set)
        return len(looked)

    small, large = effort(10), effort(20)
    assert 0 < large <= 2 * small


def test_a_file_that_others_of_the_set_include_is_one():
    write("main.xml", using("Main", "B", "C"))
    write("b.xml", using("B", "C"))
    write("c.xml", C)
    write("a.xml", '<include path="c.xml"/>', '<include path="b.xml"/>', A)
    forest = load("main.xml", set_of("a.xml", "b.xml", "c.xml"))
    assert (meant(forest), errors(forest)) == ({"B": ("b.xml", 2), "C": ("c.xml", 2)}, [])
    assert sorted(each.source.path for each in forest.others) == ["b.xml", "c.xml"]

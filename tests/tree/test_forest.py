"""Tests of includes: relative paths, one read per file, and no access outside the permitted folders."""

import os
from pathlib import Path

import pytest

from sar_compiler.checks import check
from sar_compiler.nodes.binding.nesting import find_main_tree
from sar_compiler.nodes.registry import default_registry
from sar_compiler.opener import UnreadableFileError
from sar_compiler.tree import forest
from sar_compiler.tree.diagnostic import TreeError
from sar_compiler.tree.discovery import read_tree_file
from sar_compiler.tree.forest import MAX_FILES, MAX_INCLUDE_DEPTH, load_forest
from tests.trees import write

A, B, C = (f'<BehaviorTree ID="{name}"><Success/></BehaviorTree>' for name in "ABC")


@pytest.fixture(autouse=True)
def change_to_tmp_path(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def include(path, **more):
    return (
        "<include " + " ".join(f'{name}="{value}"' for name, value in {"path": path, **more}.items()) + "/>"
    )


def load(path="main.xml", *include_paths):
    return load_forest(Path(path), read_tree_file, [Path(each) for each in include_paths])


def file_paths(forest):
    return [Path(tree_file.source.path).as_posix() for tree_file in forest.files]


def findings_of(forest):
    return [(f.code, Path(f.source.path).name, f.span.line, f.span.column) for f in forest.findings]


def test_included_file_precedes_including_file():
    write("main.xml", A, include("more.xml"), main="A")
    write("more.xml", B)
    forest = load()
    assert file_paths(forest) == ["more.xml", "main.xml"]
    assert list(forest.trees) == ["B", "A"]
    assert forest.findings == ()


def test_include_path_is_relative_to_its_file():
    write("trees/main.xml", A, include("parts/one.xml"))
    write("trees/parts/one.xml", B, include("two.xml"))
    write("trees/parts/two.xml", C)
    assert file_paths(load("trees/main.xml")) == [
        "trees/parts/two.xml",
        "trees/parts/one.xml",
        "trees/main.xml",
    ]


def test_file_included_twice_is_read_once():
    write("main.xml", include("left.xml"), include("right.xml"), include("./left.xml"), A)
    write("left.xml", include("both.xml"), B)
    write("right.xml", include("both.xml"), C)
    write("both.xml", A.replace("A", "D"))
    forest = load()
    assert file_paths(forest) == ["both.xml", "left.xml", "right.xml", "main.xml"]
    assert forest.findings == ()


def test_yaml_file_can_be_included_by_xml_file():
    write("main.xml", A, include("more.yaml"))
    Path("more.yaml").write_text(
        "root:\n  children:\n    - BehaviorTree:\n        ID: B\n        children:\n          - Success\n",
        encoding="utf-8",
    )
    assert list(load().trees) == ["B", "A"]


def test_mutual_include_is_reported_with_cycle():
    write("main.xml", A, include("one.xml"), main="A")
    write("one.xml", include("two.xml"), B)
    write("two.xml", C, include("one.xml"))
    forest = load()
    assert findings_of(forest) == [("include-cycle", "two.xml", 3, 16)]
    assert "one.xml -> two.xml -> one.xml" in forest.findings[0].message


def test_self_include_is_reported():
    write("main.xml", A, include("main.xml"))
    assert findings_of(load()) == [("include-cycle", "main.xml", 3, 16)]


@pytest.mark.parametrize("path", ["../outside.xml", "/etc/hostname", "sub/../../outside.xml"])
def test_file_outside_main_folder_is_not_read(path):
    write("outside.xml", B)
    write("trees/main.xml", A, include(path))
    forest = load("trees/main.xml")
    assert findings_of(forest) == [("include-outside", "main.xml", 3, 16)]
    assert file_paths(forest) == ["trees/main.xml"]
    assert "--include-path" in (forest.findings[0].hint or "")


def test_symlink_out_of_main_folder_is_not_followed():
    write("outside.xml", B)
    write("trees/main.xml", A, include("link.xml"))
    Path("trees/link.xml").symlink_to(Path("outside.xml").resolve())
    assert findings_of(load("trees/main.xml")) == [("include-outside", "main.xml", 3, 16)]


def test_include_from_permitted_folder_succeeds():
    write("library/part.xml", B)
    write("trees/main.xml", A, include("../library/part.xml"))
    assert load("trees/main.xml", "library").findings == ()


def test_cyclic_symlinks_are_reported():
    Path("a.xml").symlink_to("b.xml")
    Path("b.xml").symlink_to("a.xml")
    write("main.xml", A, include("a.xml"))
    assert findings_of(load()) == [("unreadable-include", "main.xml", 3, 16)]


def test_impossible_path_is_reported():
    write("main.xml", A, include("a" * 5000))
    assert findings_of(load()) == [("unreadable-include", "main.xml", 3, 16)]


def test_missing_file_is_reported_at_its_include():
    write("main.xml", A, include("gone.xml"))
    forest = load()
    assert findings_of(forest) == [("unreadable-include", "main.xml", 3, 16)]
    assert forest.findings[0].message == "cannot read gone.xml: No such file or directory"


def test_included_folder_is_reported():
    Path("folder").mkdir()
    write("main.xml", A, include("folder"))
    assert findings_of(load()) == [("unreadable-include", "main.xml", 3, 16)]


@pytest.mark.parametrize("attributes", ["", ' path=""'])
def test_include_without_path_is_reported(attributes):
    write("main.xml", A, f"<include{attributes}/>")
    ((code, _, line, _),) = findings_of(load())
    assert (code, line) == ("missing-attribute", 3)


def test_malformed_included_file_reports_its_own_findings():
    write("main.xml", A, include("bad.xml"))
    Path("bad.xml").write_text("<root>\n<BehaviorTree></root>", encoding="utf-8")
    forest = load()
    assert [(code, file, line) for code, file, line, _ in findings_of(forest)] == [
        ("malformed-xml", "bad.xml", 2)
    ]
    assert forest.findings[0].render().startswith("bad.xml:2:")


def test_missing_or_malformed_main_file_raises_error():
    with pytest.raises(UnreadableFileError, match=r"cannot read main\.xml"):
        load()
    Path("main.xml").write_text("<root>", encoding="utf-8")
    with pytest.raises(TreeError, match="malformed-xml"):
        load()


@pytest.fixture
def package():
    """Return the share folder of an installed ROS package."""
    prefix = Path("install").resolve()
    index = prefix / "share/ament_index/resource_index/packages"
    index.mkdir(parents=True)
    (index / "my_trees").touch()
    os.environ["AMENT_PREFIX_PATH"] = f"/nowhere{os.pathsep}{prefix}"
    return prefix / "share/my_trees"


@pytest.fixture(autouse=True)
def clear_workspace(monkeypatch):
    monkeypatch.setenv("AMENT_PREFIX_PATH", "")


def test_file_of_ros_package_is_found_in_sourced_workspaces(package):
    write(package / "trees/part.xml", B, include("other.xml"))
    write(package / "trees/other.xml", C)
    write("trees/main.xml", A, include("trees/part.xml", ros_pkg="my_trees"))
    forest = load("trees/main.xml")
    assert forest.findings == ()
    assert list(forest.trees) == ["C", "B", "A"]


def test_symlink_installed_package_is_found(package):
    write("source/part.xml", B, include("other.xml"))
    write("source/other.xml", C)
    package.mkdir(parents=True)
    (package / "part.xml").symlink_to(Path("source/part.xml").resolve())
    write("trees/main.xml", A, include("part.xml", ros_pkg="my_trees"))
    forest = load("trees/main.xml")
    assert forest.findings == ()
    assert list(forest.trees) == ["C", "B", "A"]


def test_path_out_of_package_is_not_read(package):
    write(package / "../secret.xml", B)
    write("trees/main.xml", A, include("../secret.xml", ros_pkg="my_trees"))
    assert findings_of(load("trees/main.xml")) == [("include-outside", "main.xml", 3, 16)]


@pytest.mark.parametrize("name", ["unknown", "", "..", "a/b", "../my_trees"])
def test_unknown_package_is_reported_at_its_name(package, name):
    write("main.xml", A, include("part.xml", ros_pkg=name))
    assert findings_of(load()) == [
        ("unknown-package", "main.xml", 3, len('<include path="part.xml" ros_pkg="') + 1)
    ]


def test_package_is_ignored_for_absolute_path(package):
    write("part.xml", B)
    write("main.xml", A, include(Path("part.xml").resolve(), ros_pkg="unknown"))
    assert load().findings == ()


def test_include_depth_is_limited():
    for number in range(MAX_INCLUDE_DEPTH + 3):
        write(f"{number}.xml", include(f"{number + 1}.xml"))
    forest = load("0.xml")
    assert findings_of(forest) == [("too-many-includes", f"{MAX_INCLUDE_DEPTH}.xml", 2, 16)]
    assert str(MAX_INCLUDE_DEPTH) in forest.findings[0].message


def test_too_many_files_are_one_finding():
    for number in range(MAX_FILES + 5):
        write(f"{number}.xml")
    write("main.xml", A, *(include(f"{number}.xml") for number in range(MAX_FILES + 5)))
    forest = load()
    assert findings_of(forest) == [("too-many-includes", "main.xml", MAX_FILES + 2, 16)]
    assert len(forest.files) == MAX_FILES


def test_requested_tree_is_main_tree():
    write("main.xml", A, include("more.xml"), main="A")
    write("more.xml", B, main="B")
    assert find_main_tree(load(), "B").attributes["ID"] == "B"


def test_main_tree_is_read_from_main_file_before_included_file():
    write("main.xml", A, B, include("more.xml"), main="B")
    write("more.xml", C, main="C")
    assert find_main_tree(load()).attributes["ID"] == "B"


def test_main_tree_can_be_in_included_file():
    write("main.xml", include("more.xml"), main="B")
    write("more.xml", A, B)
    assert find_main_tree(load()).attributes["ID"] == "B"


def test_only_tree_of_main_file_is_main_tree():
    write("main.xml", A, include("more.xml"))
    write("more.xml", B, C)
    assert find_main_tree(load()).attributes["ID"] == "A"


def test_only_included_tree_is_main_tree_of_file_without_trees():
    write("main.xml", include("more.xml"))
    write("more.xml", B)
    assert find_main_tree(load()).attributes["ID"] == "B"


def test_ambiguous_main_tree_among_included_trees_is_reported():
    write("main.xml", include("more.xml"))
    write("more.xml", A, B)
    with pytest.raises(TreeError, match=r"2 trees .*, but does not say which is the main tree"):
        find_main_tree(load())


def test_unknown_main_tree_is_reported_with_nearest_name():
    write("main.xml", A.replace("A", "Patrol"), main="Partol")
    with pytest.raises(TreeError, match=r"main\.xml:1:46: .*\n.*\n.*did you mean 'Patrol'"):
        find_main_tree(load())


def check_findings(forest):
    return [
        (f.code, Path(f.source.path).name, f.span.line, f.message) for f in check(forest, default_registry())
    ]


def test_duplicate_tree_id_names_included_file():
    write("main.xml", A, include("more.xml"))
    write("more.xml", B, A)
    assert check_findings(load()) == [
        (
            "duplicate-tree-id",
            "main.xml",
            2,
            "the tree ID 'A' is already used by the tree in line 3 of more.xml",
        )
    ]


def test_findings_are_grouped_by_file_main_file_first():
    write("main.xml", include("more.xml"), "<BehaviorTree ID='A'><Sucess/></BehaviorTree>", main="A")
    write("more.xml", "<BehaviorTree ID='B'><Sucess/></BehaviorTree>")
    assert [(code, file) for code, file, *_ in check_findings(load())] == [
        ("unknown-node", "main.xml"),
        ("unknown-node", "more.xml"),
    ]


def test_included_pipe_is_rejected_without_blocking():
    os.mkfifo("pipe.xml")
    write("main.xml", include("pipe.xml"), B)
    (finding,) = load().findings
    assert (finding.code, finding.suggestion) == ("unreadable-include", None)
    assert finding.message.endswith("pipe.xml: it is a pipe, not a file")


@pytest.mark.parametrize(
    ("there", "meant", "suggestion"),
    [
        ("parts.xml", "part.xml", "parts.xml"),
        ("parts.xml", "parts.xlm", "parts.xml"),
        ("parts.yaml", "parts.xml", "parts.yaml"),
        ("43_switch_children.xml", "no_such_file.xml", None),
        ("ab.xml", "cd.xml", None),
    ],
)
def test_only_similar_file_name_is_suggested(there, meant, suggestion):
    write(there, A)
    write("main.xml", include(meant), B)
    assert [finding.suggestion for finding in load().findings] == [suggestion]


def test_folder_is_not_suggested_for_itself():
    Path("d.xml").mkdir()
    write("main.xml", include("d.xml"), B)
    (finding,) = load().findings
    assert (finding.code, finding.suggestion) == ("unreadable-include", None)


def test_number_of_compared_file_names_is_limited(monkeypatch):
    monkeypatch.setattr(forest, "MAX_NEIGHBOURS", 2)
    for name in ("arm.xml", "leg.xml"):
        write(name, A)
    write("main.xml", include("arn.xml"), include("lag.xml"), B)
    assert [finding.suggestion for finding in load().findings] == ["arm.xml", None]

"""Tests that `validate` reports each cause once, and each location in the formats for tools."""

import json
import re

import pytest

from tests.cli import command_runner
from tests.cli.test_validate_several_files import folder, write  # noqa: F401 - a fixture
from tests.trees import document


def run(capsys, *arguments):
    return command_runner.run(capsys, "validate", *arguments)


def heads(out):
    """Return the first line of each printed finding."""
    return [line for line in out.splitlines() if re.match(r"\S+:\d+:\d+: \w+\[", line)]


def tree_of(*tags):
    return document(f"<Sequence>{''.join(f'<{tag}/>' for tag in tags)}</Sequence>")


def palette_of(tag, port="strength"):
    model = f'<Action ID="{tag}"><input_port name="{port}"/></Action>'
    return f'<root BTCPP_format="4"><TreeNodesModel>{model}</TreeNodesModel></root>'


def test_unknown_name_in_several_files_is_reported_once_with_other_locations(capsys):
    for name in "abc":
        write(f"ws/{name}.xml", tree_of("Grasp"))
    _, out, err = run(capsys, "ws")
    assert len(heads(out)) == 1
    assert "there is no node 'Grasp' (also in 2 other places: ws/b.xml:3, ws/c.xml:3)" in out
    assert err == "1 error in 3 files; --all lists 3 locations\n"


@pytest.mark.parametrize(("places", "told"), [(1, 1), (3, 3), (4, 1), (12, 1)])
def test_up_to_three_locations_in_one_file_are_listed_individually(capsys, places, told):
    write("a.xml", tree_of(*["Grasp"] * places))
    assert len(heads(run(capsys, "a.xml")[1])) == told


def test_all_option_lists_each_location(capsys):
    write("a.xml", tree_of(*["Grasp"] * 12))
    _, out, err = run(capsys, "--all", "a.xml")
    assert len(heads(out)) == 12
    assert err == "12 errors in 1 file\n"


def test_causes_are_ordered_by_first_location(capsys):
    write("a.xml", tree_of("Grasp", "Place"))
    write("b.xml", tree_of("Lift", "Grasp"))
    told = heads(run(capsys, "a.xml", "b.xml")[1])
    assert [head.split("'")[1] for head in told] == ["Grasp", "Place", "Lift"]


def test_findings_of_different_severity_are_not_merged(capsys):
    write("a/sar.toml", '[findings]\nneedless-node = "warning"\n')
    for name in ("a/tree.xml", "b/tree.xml"):
        write(name, document("<Sequence><AlwaysSuccess/></Sequence>"))
    out = run(capsys, "a/tree.xml", "b/tree.xml")[1]
    assert (out.count("warning[needless-node]"), out.count("info[needless-node]")) == (1, 1)


def test_json_lists_each_location_with_its_cause(capsys):
    write("ws/a.xml", tree_of("Grasp", "Sequence"))
    write("ws/b.xml", tree_of("Grasp"))
    found = json.loads(run(capsys, "--format", "json", "ws")[1])
    grasp, empty, other = [each["cause"] for each in found]
    assert (grasp == other, grasp == empty) == (True, False)


def test_more_than_three_unknown_names_are_reported_as_one_cause(capsys):
    write("a.xml", tree_of("Grasp", "Place", "Lift", "Grasp"))
    assert len(heads(run(capsys, "a.xml")[1])) == 4
    write("a.xml", tree_of("Grasp", "Place", "Lift", "Grasp", "Weld"))
    (told,) = heads(run(capsys, "a.xml")[1])
    names = "'Grasp' (2), 'Place' (1), 'Lift' (1), 'Weld' (1), in 5 places"
    assert told.endswith(f"there are no nodes of these names: {names}")


def test_palette_in_folder_describes_nodes_of_its_trees_and_is_named(capsys):
    write("ws/trees/a.xml", tree_of("Grasp"))
    write("ws/arm_tree_nodes.xml", palette_of("Grasp"))
    status, _, err = run(capsys, "ws")
    assert (status, err.splitlines()[0]) == (0, "note: nodes are described by ws/arm_tree_nodes.xml")
    said = (0, "ws/trees/a.xml: no findings\n", "note: nodes are described by ws/arm_tree_nodes.xml\n")
    assert run(capsys, "ws/trees/a.xml") == said
    assert run(capsys, "--isolated", "ws/trees/a.xml")[0] == 1


def test_groot2_project_describes_nodes(capsys):
    write("ws/a.xml", tree_of("Grasp"))
    write("ws/arm.btproj", palette_of("Grasp"))
    assert run(capsys, "ws")[0] == 0


def test_nearest_of_several_palettes_applies(capsys):
    for robot, port in (("one", "force"), ("two", "width")):
        write(f"ws/{robot}/nodes.xml", palette_of("Grasp", port))
        write(f"ws/{robot}/tree.xml", document(f'<Grasp {port}="1"/>'))
    assert run(capsys, "--format", "json", "ws")[1] == "[]\n"


def test_palette_applies_to_all_files_even_if_one_has_own_model(capsys):
    own = palette_of("Grasp").partition("<TreeNodesModel>")[2].partition("</root>")[0]
    main = document('<Sequence><Grasp strength="1"/><SubTree ID="Other"/></Sequence>')
    write("ws/a.xml", main.replace("</root>", f"<TreeNodesModel>{own}</root>"))
    write("ws/b.xml", document('<Grasp strength="1"/>', main="Other"))
    write("ws/nodes.xml", palette_of("Grasp"))
    assert run(capsys, "--format", "json", "ws")[1] == "[]\n"


def test_palette_does_not_describe_subtree_that_file_contains(capsys):
    inner = '<BehaviorTree ID="Other"><AlwaysSuccess/></BehaviorTree>'
    write("ws/a.xml", document('<SubTree ID="Other"/>').replace("</root>", f"{inner}</root>"))
    write("ws/old/nodes.xml", palette_of("Other").replace("Action", "SubTree"))
    assert run(capsys, "ws")[0] == 0


def test_tree_defined_in_several_files_is_warning(capsys):
    write("ws/main.xml", document('<SubTree ID="Grip"/>'))
    for robot in "ab":
        write(f"ws/{robot}/grip.xml", document(f'<AlwaysSuccess name="{robot}"/>', main="Grip"))
    status, out, _ = run(capsys, "ws")
    assert (status, "warning[duplicate-tree-id]" in out) == (0, True)


def test_sarif_lists_each_location_with_its_cause(capsys):
    write("a.xml", tree_of(*["Grasp"] * 5))
    results = json.loads(run(capsys, "--format", "sarif", "a.xml")[1])["runs"][0]["results"]
    causes = [each["properties"]["cause"] for each in results]
    assert causes == ["unknown-node: there are no nodes of these names"] * 5


@pytest.mark.parametrize(("options", "told"), [((), 1), (("--all",), 5)])
def test_github_format_reports_each_cause_once_without_all_option(capsys, options, told):
    write("a.xml", tree_of(*["Grasp"] * 5))
    assert run(capsys, "--format", "github", *options, "a.xml")[1].count("::error ") == told


def test_exit_status_does_not_depend_on_all_option(capsys):
    for name in "abcde":
        write(f"ws/{name}.xml", tree_of("Grasp"))
    assert run(capsys, "ws")[0] == run(capsys, "--all", "ws")[0] == 1

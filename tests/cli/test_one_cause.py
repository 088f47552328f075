"""`validate` tells each cause once, and each place where tools read it."""

import json
import re

import pytest

from tests.cli import running
from tests.cli.test_validating_several import folder, write  # noqa: F401 - a fixture
from tests.trees import document


def run(capsys, *arguments):
    return running.run(capsys, "validate", *arguments)


def heads(out):
    """Return the first lines of the findings in what was printed."""
    return [line for line in out.splitlines() if re.match(r"\S+:\d+:\d+: \w+\[", line)]


def tree_of(*tags):
    return document(f"<Sequence>{''.join(f'<{tag}/>' for tag in tags)}</Sequence>")


def test_a_name_that_is_unknown_in_several_files_is_told_once_with_the_other_places(capsys):
    for name in "abc":
        write(f"ws/{name}.xml", tree_of("Grasp"))
    _, out, err = run(capsys, "ws")
    assert len(heads(out)) == 1
    assert "no node is called 'Grasp'; and in 2 more places: ws/b.xml:3, ws/c.xml:3" in out
    assert err == "1 error in 3 files; --all tells 3 places\n"


@pytest.mark.parametrize(("places", "told"), [(1, 1), (3, 3), (4, 1), (12, 1)])
def test_up_to_three_places_in_one_file_are_told_one_by_one(capsys, places, told):
    write("a.xml", tree_of(*["Grasp"] * places))
    assert len(heads(run(capsys, "a.xml")[1])) == told


def test_all_tells_each_place(capsys):
    write("a.xml", tree_of(*["Grasp"] * 12))
    _, out, err = run(capsys, "--all", "a.xml")
    assert len(heads(out)) == 12
    assert err == "12 errors in 1 file\n"


def test_the_order_of_what_is_told_is_that_of_the_first_places(capsys):
    write("a.xml", tree_of("Grasp", "Place"))
    write("b.xml", tree_of("Lift", "Grasp"))
    told = heads(run(capsys, "a.xml", "b.xml")[1])
    assert [head.split("'")[1] for head in told] == ["Grasp", "Place", "Lift"]


def test_an_error_and_a_warning_are_not_told_as_one(capsys):
    write("a/sar.toml", '[findings]\nneedless-node = "warning"\n')
    for name in ("a/tree.xml", "b/tree.xml"):
        write(name, document("<Sequence><AlwaysSuccess/></Sequence>"))
    out = run(capsys, "a/tree.xml", "b/tree.xml")[1]
    assert (out.count("warning[needless-node]"), out.count("info[needless-node]")) == (1, 1)


def test_json_has_every_place_and_equal_causes_for_those_of_one(capsys):
    write("ws/a.xml", tree_of("Grasp", "Place"))
    write("ws/b.xml", tree_of("Grasp"))
    found = json.loads(run(capsys, "--format", "json", "ws")[1])
    grasp, place, other = [each["cause"] for each in found]
    assert (grasp, grasp == other, grasp == place) == ("unknown-node: no node is called 'Grasp'", True, False)


def test_sarif_has_every_place_with_its_cause(capsys):
    write("a.xml", tree_of(*["Grasp"] * 5))
    results = json.loads(run(capsys, "--format", "sarif", "a.xml")[1])["runs"][0]["results"]
    assert [each["properties"]["cause"] for each in results] == [
        "unknown-node: no node is called 'Grasp'"
    ] * 5


@pytest.mark.parametrize(("options", "told"), [((), 1), (("--all",), 5)])
def test_github_is_told_each_cause_once(capsys, options, told):
    write("a.xml", tree_of(*["Grasp"] * 5))
    assert run(capsys, "--format", "github", *options, "a.xml")[1].count("::error ") == told


def test_the_exit_status_is_that_of_all_places(capsys):
    for name in "abcde":
        write(f"ws/{name}.xml", tree_of("Grasp"))
    assert run(capsys, "ws")[0] == run(capsys, "--all", "ws")[0] == 1

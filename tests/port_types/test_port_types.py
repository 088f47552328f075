"""Tests of every pair of C++ types on one key, against the verdicts of BehaviorTree.CPP.

What BehaviorTree.CPP rejects must be reported, and a tree that it runs must not be an error. `verdicts.txt`
has the verdict on each tree of `trees.py`, by version and family: a line of letters for each row, one for
each column. `c`: the tree was created, and ticked without an error. `r`: it was rejected. `t`: a tick raised
an error.
"""

import functools
from collections.abc import Mapping
from pathlib import Path

import pytest

from sar_compiler import checks
from sar_compiler.checks import check
from sar_compiler.checks.btcpp_conversion import convert_to_btcpp
from sar_compiler.nodes.btcpp import VERSIONS
from sar_compiler.nodes.registry import default_registry
from sar_compiler.tree.diagnostic import Severity
from tests.port_types.trees import CONSTANTS, TYPES, Tree, trees, write
from tests.trees import forest_of

CODES = (
    *("key-of-two-types", "cpp-type-mismatch", "btcpp-version", "wrong-value", "out-of-reach"),
    *("failing-script", "unwritten-key"),
)
OWN_TYPES = {"Pose", "Path", "Colour"}
WRITTEN_LAST = ("written then scripted", "port then write")


@pytest.fixture(autouse=True)
def _without_schema(monkeypatch):
    """Turn off the schema check: it finds none of these codes, and is rebuilt for each tree."""
    monkeypatch.setattr(checks, "_schema_findings", lambda *_: [])


@functools.cache
def verdicts(version: str) -> Mapping[str, Mapping[tuple[str, str], str]]:
    """Return the verdicts of a version: by family, the letter of each row and column."""
    found: dict[str, dict[tuple[str, str], str]] = {}
    rows, columns = {}, []
    for line in Path(__file__).with_name("verdicts.txt").read_text(encoding="utf-8").splitlines():
        if line.startswith("== "):
            said, _, family = line.removeprefix("== ").partition(": ")
            rows = found.setdefault(family, {}) if said == version else {}
        elif line.startswith(" "):
            columns = line.split()
        else:
            letters, _, row = line.partition(" ")
            rows.update({(row, column): letter for column, letter in zip(columns, letters, strict=True)})
    return found


@functools.cache
def families() -> Mapping[str, list[Tree]]:
    found: dict[str, list[Tree]] = {}
    for tree in trees():
        found.setdefault(tree.family, []).append(tree)
    return found


# Reasons why a tree that BehaviorTree.CPP rejects needs no finding.
SILENT = {
    "what a port without a type writes is not known": lambda tree, written: (
        {written, tree.row} & {"Any", "untyped"}
    ),
    "the C++ of a node may read a text from a port without a type, or write a value of any type": lambda tree, _: (
        tree.column in {"Any", "untyped"}
        and tree.family in {"literal", "constant overwritten", "port then write", "written twice"}
    ),
    "the text that a leaf writes may be the word for a status": lambda tree, _: (
        tree.row == "string" and tree.column in {"Status", "else", "if_empty"}
    ),
    "the status that a leaf writes may be one of the two that are truth values": lambda tree, _: (
        tree[1:3] == ("Status", "bool")
    ),
}


def may_be_silent(tree: Tree) -> bool:
    written = tree.column if tree.family in WRITTEN_LAST else tree.row
    return any(applies(tree, written) for applies in SILENT.values())


def is_noted(tree: Tree) -> bool:
    """Return whether C++ code decides, by reading a user's type from a string; a note reports this."""
    written = tree.column if tree.family in WRITTEN_LAST else tree.row
    return bool({tree.row, tree.column} & OWN_TYPES) and is_text(written)


def is_text(written: str) -> bool:
    """Return whether a value is a string for BehaviorTree.CPP; constants always are."""
    return written in {"string", "LoopString"} or written in CONSTANTS or written.startswith("'")


def may_be_error(tree: Tree) -> str:
    """Return why a tree that BehaviorTree.CPP runs is an error here; empty if it must not be one."""
    row, column = tree.row, tree.column
    if column == "RunOnce":
        return "RunOnce there passes over an attribute that it cannot read"
    if (row, column) == ("+5", "code"):
        return "no script begins with a plus here"
    if column == "Delay":
        return "so does Delay before 4.9"
    if row.startswith("json:") and column == "strings":
        return "before 4.9, a list of texts there is never read as JSON"
    texts = {row.strip("'"), column.strip("'")}
    if texts & {"3.5", "1e3", "1;2", "1;2;3"}:
        return "all of a text must be a number here, and only its front there"
    return ""


@functools.cache
def severities(tree: Tree, version=None):
    found = check(forest_of(tree.text()), default_registry(), (), version)
    return {each.severity for each in found if each.code in CODES}


# By family: two versions need the same findings.
PAIRS = [
    pytest.param(version, family, id=f"{version} {family}")
    for family in verdicts("4.10")
    for version in ("4.8.4", "4.9.0", "4.10")
    if family in verdicts(version)
]


@pytest.mark.parametrize(("release", "family"), PAIRS)
def test_trees_rejected_by_btcpp_are_reported_and_accepted_ones_are_no_errors(release, family):
    # 4.9 has the rules of its last release, which types constants as 4.10 does; 4.8 reads strings as 4.9.0
    # does.
    version = {"4.10": None, "4.9.0": VERSIONS["4.8"], "4.8.4": VERSIONS["4.8"]}[release]
    known = verdicts(release)[family]
    older = verdicts("4.8.4").get(family, {}) if release == "4.9.0" else {}
    assert {(tree.row, tree.column) for tree in families()[family]} == set(known)
    silent, wrong = [], []
    for tree in families()[family]:
        verdict = known[tree.row, tree.column]
        if older and older[tree.row, tree.column] != verdict:
            continue
        found = severities(tree, version)
        told = {Severity.WARNING, Severity.ERROR, *([Severity.INFO] if is_noted(tree) else ())}
        if verdict in "rt" and not found & told and not may_be_silent(tree):
            silent.append((tree.row, tree.column, verdict))
        if verdict == "c" and Severity.ERROR in found and not may_be_error(tree):
            wrong.append((tree.row, tree.column))
    assert (silent, wrong) == ([], [])


def test_port_conflicts_rejected_by_btcpp_are_reported_without_exception():
    for family in ("write then read", "through two subtrees", "write then change", "write then take", "item"):
        known = verdicts("4.10")[family]
        refused = [tree for tree in families()[family] if known[tree.row, tree.column] == "r"]
        assert refused
        assert [tree[1:3] for tree in refused if not severities(tree) - {Severity.INFO}] == []


@pytest.mark.parametrize("family", ["write then read", "constant", "write then take"])
def test_rejected_tree_is_error_if_project_targets_btcpp(family):
    known = verdicts("4.10")[family]
    for tree in families()[family]:
        if known[tree.row, tree.column] == "r":
            assert Severity.ERROR in severities(tree, VERSIONS["4.10"]), tree[1:3]


@pytest.mark.parametrize("family", verdicts("4.10"))
def test_rejected_tree_is_not_converted_without_finding(family):
    known = verdicts("4.10")[family]
    for tree in families()[family]:
        if known[tree.row, tree.column] == "r" and not (may_be_silent(tree) or is_noted(tree)):
            losses = convert_to_btcpp(forest_of(tree.text()), default_registry()).losses
            assert [each for each in losses if each.severity is not Severity.INFO], tree[1:3]


TYPES_OF_COUNTS = {"unsigned": True, "double": True, "bool": True, "Pose": True, "ints": True, "int": False}


@pytest.mark.parametrize(("name", "is_refused"), TYPES_OF_COUNTS.items())
@pytest.mark.parametrize(
    "node",
    [
        '<Retry num_failures="{k}"><AlwaysSuccess/></Retry>',
        '<Repeat num_success="{k}"><AlwaysSuccess/></Repeat>',
    ],
)
def test_conversion_checks_types_of_written_file(node, name, is_refused):
    # The ports of Retry and Repeat have no direction here; the ports they are converted to have the type int.
    tree = Tree("counted", name, "", write(name) + node)
    losses = convert_to_btcpp(forest_of(tree.text()), default_registry()).losses
    refused = [each for each in losses if each.severity is not Severity.INFO]
    assert len(refused) == is_refused


def test_converted_number_is_checked_as_written():
    text = '<root BTCPP_format="4"><BehaviorTree ID="M"><Timer duration="1.5"/></BehaviorTree></root>'
    assert convert_to_btcpp(forest_of(text), default_registry()).losses == ()
    late = text.replace("1.5", "5000000")
    (loss,) = convert_to_btcpp(forest_of(late), default_registry()).losses
    assert "does not fit into" in loss.message


def test_each_type_is_compatible_with_itself():
    for name in TYPES:
        tree = next(each for each in families()["write then read"] if each.row == each.column == name)
        assert severities(tree) == set()

"""Tests of a project's configuration file, and of the findings about its errors."""

import pytest

from sar_compiler.checks.configuration import NOTHING_DECIDED, configuration_for
from sar_compiler.tree.diagnostic import Severity, TreeError


@pytest.fixture
def tree(tmp_path, monkeypatch):
    folder = tmp_path / "project" / "trees"
    folder.mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "project")
    return folder / "tree.xml"


def write(path, text):
    path.write_text(text, encoding="utf-8")


def configuration_errors(tree):
    with pytest.raises(TreeError) as caught:
        configuration_for(tree)
    return [
        (each.source.path, each.code, each.span.line, each.span.column, each.suggestion)
        for each in caught.value.findings
    ]


def test_missing_file_gives_default_configuration(tree):
    assert configuration_for(tree) is NOTHING_DECIDED


def test_file_is_searched_from_tree_upwards(tree):
    (tree.parents[2] / ".git").mkdir()
    write(tree.parents[1] / "sar.toml", 'nodes = ["a.b"]\nmodels = ["m.xml"]\ninclude-path = ["../x"]\n')
    found = configuration_for(tree)
    project = tree.parents[1]
    assert (found.nodes, found.models, found.include_path) == (
        ("a.b",),
        (project / "m.xml",),
        (project / "../x",),
    )


def test_only_nearest_file_applies(tree):
    write(tree.parents[1] / "sar.toml", '[findings]\nsame-name = "off"\n')
    write(tree.parent / "pyproject.toml", '[tool.sar.findings]\nunread-key = "error"\n')
    assert configuration_for(tree).severities == {"unread-key": Severity.ERROR}


def test_sar_toml_takes_precedence_over_pyproject_toml(tree):
    write(tree.parent / "sar.toml", '[findings]\nsame-name = "off"\n')
    write(tree.parent / "pyproject.toml", '[tool.sar.findings]\nsame-name = "error"\n')
    assert configuration_for(tree).severities == {"same-name": None}


def test_pyproject_toml_without_project_table_is_skipped(tree):
    write(tree.parents[1] / "sar.toml", 'nodes = ["a"]\n')
    write(tree.parent / "pyproject.toml", '[project]\nname = "sar"\n[tool.other]\nx = 1\n')
    assert configuration_for(tree).nodes == ("a",)


def test_pyproject_toml_that_never_mentions_project_need_not_be_valid(tree):
    write(tree.parent / "pyproject.toml", "nothing = of the kind, sar-compile\n")
    assert configuration_for(tree) is NOTHING_DECIDED


ERRORS = {
    "an unknown setting": ('model = ["a"]', "unknown-key", 1, 1, "models"),
    "a text where a list belongs": ('\nnodes = "a"', "wrong-shape", 2, 10, None),
    "a list of numbers": ("include-path = [ 1]", "wrong-value", 1, 18, '"1"'),
    "a list of dates": ("models = [1979-05-27 07:32:00]", "wrong-value", 1, 11, '"1979-05-27 07:32:00"'),
    "a version that is a number": ("[language]\nbtcpp = 4.8", "wrong-value", 2, 9, '"4.8"'),
    "a version that is another number": ("[language]\nbtcpp = 4.10", "wrong-value", 2, 9, '"4.10"'),
    "findings that are no table": ('findings = "off"', "wrong-shape", 1, 13, None),
    "findings that are a list of tables": ("[[findings]]", "wrong-shape", 1, 3, None),
    "an unknown kind of finding": ('[findings]\nsame-nam = "off"', "unknown-key", 2, 1, "same-name"),
    "an unknown severity": ('[findings]\nsame-name = "of"', "wrong-value", 2, 14, "off"),
    "a severity that is no text": ("[findings]\nsame-name = 1", "wrong-value", 2, 13, None),
    "an error that is turned off": ('[findings]\nunknown-node = "off"', "wrong-value", 2, 17, None),
    "an error that is made less": ('[findings]\nunknown-node = "warning"', "wrong-value", 2, 17, None),
    "palettes outside": ('models = ["a.xml", "../b.xml"]', "setting-outside", 1, 21, None),
    "a folder outside": ('include-path = ["/etc"]', "setting-outside", 1, 18, None),
    "what is not TOML": ("nodes = [\n", "malformed-toml", 1, 10, None),
    "what is not TOML in a line": ("a = 1\nnodes = a\n", "malformed-toml", 2, 9, None),
    "brackets without end": (f"a = {'[' * 2000}", "too-deep", 1, 1, None),
    "what is not text": ("a = '\0'", "wrong-encoding", 1, 6, None),
    # The name of a setting also occurs in comments and strings.
    "a comment before": (
        '# same-nam is noisy\n[findings]\nsame-nam = "off"',
        "unknown-key",
        3,
        1,
        "same-name",
    ),
    "a comment behind": ('[findings] # same-nam\nsame-nam = "off"', "unknown-key", 2, 1, "same-name"),
    "a text before": ('nodes = ["""\nmodel = 1"""]\nmodel = 1', "unknown-key", 3, 1, "models"),
    "texts before": (
        "nodes = ['''model = 1''', 'model', \"\\\"model\"]\nmodel = 1",
        "unknown-key",
        2,
        1,
        "models",
    ),
    "a dotted key": ('findings.same-name = "of"', "wrong-value", 1, 23, "off"),
    "a key in quotes": ('findings."same-name" = "of"', "wrong-value", 1, 25, "off"),
    "a key with an escape": ('findings."same\\u002Dnam" = "of"', "unknown-key", 1, 11, "same-name"),
    "a table in braces": (
        'findings = {never-ends = "off", same-name = "of"} # of',
        "wrong-value",
        1,
        46,
        "off",
    ),
    "a list over lines": ('nodes = [\n  "a", # 2\n  2,\n]', "wrong-value", 3, 3, '"2"'),
}


@pytest.mark.parametrize("name", ERRORS)
def test_error_is_reported_with_location(tree, name):
    text, *expected = ERRORS[name]
    write(tree.parents[1] / "sar.toml", text)
    assert configuration_errors(tree) == [("sar.toml", *expected)]


@pytest.mark.parametrize(
    ("text", "message", "advice"),
    [
        (
            "[language]\nbtcpp = 4.8",
            "'btcpp' must be one of 4.8, 4.9, 4.10, but 4.8 without quotes is a number",
            "did you mean '\"4.8\"'?",
        ),
        (
            "[language]\nbtcpp = 4.8.2  # Jazzy's",
            "not valid TOML: Expected newline or end of document after a statement",
            'write strings in quotes: "4.8.2"',
        ),
        ("nodes = leaves", "not valid TOML: Invalid value", 'write strings in quotes: "leaves"'),
        (
            "nodes = [true]",
            "an item of 'nodes' must be a string, but true without quotes is true or false",
            None,
        ),
    ],
)
def test_missing_quotes_are_reported(tree, text, message, advice):
    write(tree.parents[1] / "sar.toml", text)
    with pytest.raises(TreeError) as caught:
        configuration_for(tree)
    [found] = caught.value.findings
    assert (found.message, found.advice) == (message, advice or "did you mean '\"true\"'?")


def test_error_in_pyproject_toml_is_located_in_project_table(tree):
    text = '[tool.other.findings]\nsame-nam = 1\n[tool.sar.findings]\nsame-nam = "off"\n'
    write(tree.parents[1] / "pyproject.toml", text)
    assert configuration_errors(tree) == [("pyproject.toml", "unknown-key", 4, 1, "same-name")]


def test_all_errors_of_file_are_reported_at_once(tree):
    text = 'model = 1\nnodes = 1\n[findings]\nsame-name = "of"\nsame-nam = "off"\n'
    write(tree.parents[1] / "sar.toml", text)
    assert [(line, column) for _, _, line, column, _ in configuration_errors(tree)] == [
        (1, 1),
        (2, 9),
        (4, 14),
        (5, 1),
    ]


def test_tables_of_other_tools_in_pyproject_toml_are_skipped(tree):
    text = "[[tool.a.b]]\nx = 1\n[[tool.a.b]]\nx = {y = [[1], [{}]]}\n[tool.sar]\nnodes = 1\n"
    write(tree.parents[1] / "pyproject.toml", text)
    assert configuration_errors(tree) == [("pyproject.toml", "wrong-shape", 6, 9, None)]


@pytest.mark.parametrize("text", ["", " \n", "# nothing\n"])
def test_empty_file_gives_default_configuration(tree, text):
    write(tree.parents[1] / "sar.toml", text)
    assert configuration_for(tree) is NOTHING_DECIDED


def test_severity_of_error_may_be_set_to_error(tree):
    write(tree.parent / "sar.toml", '[findings]\nunknown-node = "error"\n')
    assert configuration_for(tree).severities == {"unknown-node": Severity.ERROR}

"""Tests of values with locations: how scalars are read, and which values remain after validation."""

import subprocess
import sys

import pytest

from sar_compiler.documents.yaml_files import parse_yaml
from sar_compiler.tree.diagnostic import TreeError


def read(text):
    return parse_yaml(text, "file.yaml", "write something")


@pytest.mark.parametrize(
    ("text", "data"),
    [
        ("3", 3),
        ("-1.5e1", -15.0),
        ("true", True),
        ("yes", "yes"),
        ("on", "on"),
        ("True", "True"),
        ("12:30", "12:30"),
        ("1e999", "1e999"),
        ("inf", "inf"),
        (".nan", ".nan"),
        ("'3'", "3"),
        ("''", ""),
        ("null", "null"),
        ("", None),
    ],
)
def test_scalar_is_read_as_written(text, data):
    assert read(f"key: {text}").root.data == {"key": data}
    assert type(read(f"key: {text}").root.data["key"]) is type(data)


def test_values_refused_by_schema_are_omitted_and_rest_is_kept():
    document = read("name: [a]\nticks: 3\nexpect: {root: SUCESS, never: [A starts, [B]]}\n")
    assert document.validate("scenario").data == {"ticks": 3, "expect": {"never": ["A starts"]}}
    assert [(each.code, each.span.line) for each in document.findings] == [
        ("wrong-shape", 1),
        ("wrong-value", 3),
        ("wrong-shape", 3),
    ]


def test_mapping_without_required_key_is_omitted():
    document = read("leaves: {A: {outcome: [x]}, B: {outcome: SUCCESS}}")
    assert document.validate("scenario").data == {"leaves": {"B": {"outcome": "SUCCESS"}}}
    assert len(document.findings) == 1  # only the finding about the outcome


def test_misspelt_key_is_not_also_reported_missing():
    document = read("leaves: {A: {outcom: SUCCESS}}")
    document.validate("scenario")
    assert [(each.code, each.suggestion) for each in document.findings] == [("unknown-key", "outcome")]


def test_missing_keys_of_mapping_are_one_finding():
    with pytest.raises(TreeError) as caught:
        read("robot: {}\nwalls: []").validate("world")
    assert [each.message for each in caught.value.findings] == ["'robot' needs 'x', 'y' and 'radius'"]


@pytest.mark.parametrize(
    ("text", "message", "advice"),
    [
        ("leaves: {A: {after: 1s}}", "the outcome of a leaf needs 'outcome'", "for example outcome: SUCCESS"),
        ("leaves: {A: }", "'A' must be a mapping, a list or a string, but is empty", ""),
        (
            "ticks: '5'",
            "'ticks' must be an integer of at least 1, but 5 in quotes is a string",
            "write 5, without quotes",
        ),
        (
            "period: soon",
            "'period' must be a duration above 0, but is 'soon'",
            "for example 4s, 500ms or 2min",
        ),
        (
            "expect: {root: SUCESS}",
            "'root' must be one of SUCCESS, FAILURE, RUNNING, SKIPPED, but is 'SUCESS'",
            "did you mean 'SUCCESS'?",
        ),
        ("expect: {count: {A starts: few}}", "but is 'few'", "for example 2, at least 2 or at most 2"),
    ],
)
def test_finding_states_expected_value_and_advice(text, message, advice):
    document = read(text)
    document.validate("scenario")
    assert [each.message.endswith(message) for each in document.findings] == [True]
    assert document.findings[0].advice == advice


def test_finding_about_mapping_marks_its_first_line():
    document = read("name:\n  a: 1\n  b: 2\n")
    document.validate("scenario")
    (span,) = [each.span for each in document.findings]
    assert (span.line, span.column, span.end_line, span.end_column) == (2, 3, 2, 7)


def test_unusable_file_raises_all_findings():
    with pytest.raises(TreeError) as caught:
        read("wals: 1\nzons: 2").validate("world")
    assert [each.suggestion for each in caught.value.findings] == ["walls", None, "zones"]


def test_findings_are_unique_and_in_file_order():
    document = read("b: 1\na: 2")
    for key, _ in reversed(document.root.entries or ()):
        for _ in range(2):
            document.report("wrong-value", "no", key)
    with pytest.raises(TreeError) as caught:
        document.raise_findings()
    assert [each.span.line for each in caught.value.findings] == [1, 2]


@pytest.mark.parametrize(
    ("module", "statement"),
    [
        ("jsonschema", "main(['validate', 'trees/search_and_rescue.xml'])"),
        ("yaml", "main(['validate', 'trees/search_and_rescue.xml'])"),
        ("tomllib", "main(['validate', 'trees/search_and_rescue.xml'])"),
        ("jsonschema", "main(['show', 'trees/search_and_rescue.xml'])"),
        ("jsonschema", "main(['simulate', 'trees/search_and_rescue.xml'])"),
    ],
)
def test_document_library_is_imported_only_if_needed(module, statement):
    program = f"import sys\nfrom sar_compiler.cli.compile import main\n{statement}\n"
    done = subprocess.run(
        [sys.executable, "-c", f"{program}sys.exit({module!r} in sys.modules)"],
        capture_output=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr

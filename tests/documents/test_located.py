"""Values with places: what a scalar means, and what is left when a schema has refused some of them."""

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
def test_a_scalar_means_what_is_written(text, data):
    assert read(f"key: {text}").root.data == {"key": data}
    assert type(read(f"key: {text}").root.data["key"]) is type(data)


def test_what_a_schema_refuses_is_left_out_and_the_rest_is_kept():
    document = read("name: [a]\nticks: 3\nexpect: {root: SUCESS, never: [A starts, [B]]}\n")
    assert document.validate("scenario").data == {"ticks": 3, "expect": {"never": ["A starts"]}}
    assert [(each.code, each.span.line) for each in document.findings] == [
        ("wrong-shape", 1),
        ("wrong-value", 3),
        ("wrong-shape", 3),
    ]


def test_a_mapping_without_a_key_that_it_needs_is_left_out_as_a_whole():
    document = read("leaves: {A: {outcome: [x]}, B: {outcome: SUCCESS}}")
    assert document.validate("scenario").data == {"leaves": {"B": {"outcome": "SUCCESS"}}}
    assert len(document.findings) == 1  # only what is wrong with the answer


def test_a_misspelt_key_is_not_said_to_be_missing_as_well():
    document = read("leaves: {A: {outcom: SUCCESS}}")
    document.validate("scenario")
    assert [(each.code, each.suggestion) for each in document.findings] == [("unknown-key", "outcome")]


def test_several_missing_keys_of_a_mapping_are_one_finding():
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
def test_a_finding_says_what_is_wanted_and_what_to_write(text, message, advice):
    document = read(text)
    document.validate("scenario")
    assert [each.message.endswith(message) for each in document.findings] == [True]
    assert document.findings[0].advice == advice


def test_a_finding_about_a_mapping_underlines_its_first_line():
    document = read("name:\n  a: 1\n  b: 2\n")
    document.validate("scenario")
    (span,) = [each.span for each in document.findings]
    assert (span.line, span.column, span.end_line, span.end_column) == (2, 3, 2, 7)


def test_a_file_of_which_nothing_can_be_used_raises_all_that_is_wrong():
    with pytest.raises(TreeError) as caught:
        read("wals: 1\nzons: 2").validate("world")
    assert [each.suggestion for each in caught.value.findings] == ["walls", None, "zones"]


def test_findings_come_in_the_order_of_the_file_and_once_each():
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
def test_nobody_without_such_a_file_waits_for_its_library(module, statement):
    program = f"import sys\nfrom sar_compiler.cli.compile import main\n{statement}\n"
    done = subprocess.run(
        [sys.executable, "-c", f"{program}sys.exit({module!r} in sys.modules)"],
        capture_output=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr

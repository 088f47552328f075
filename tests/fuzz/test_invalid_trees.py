"""Tests of invalid trees: no rule crashes, and every command ends with output."""

import contextlib
import io
import itertools
import tempfile
from pathlib import Path
from xml.sax.saxutils import quoteattr

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sar_compiler.checks import check
from sar_compiler.cli.compile import main
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.xml import parse_xml
from tests.fuzz.random_trees import PARENTS, REGISTRY, tree_texts, wrong_tree_texts
from tests.fuzz.test_near_misses import required_values
from tests.random_inputs import rounds

COMMANDS = [
    *(f"validate a.xml b.xml --format {form}" for form in ("text", "json", "sarif", "github")),
    *(f"show a.xml --format {form}" for form in ("unicode", "ascii", "json", "svg", "mermaid", "dot")),
    *(f"convert a.xml --to {form}" for form in ("xml", "yaml", "btcpp")),
    "diff a.xml b.xml",
    "format a.xml",
    "validate a.xml --fix",
    "validate a.xml --model b.xml",
]
CHILDREN = ["<AlwaysSuccess/>", "<AlwaysFailure/>", "<Running/>", "<TestA/>"]


def answer(command, texts):
    """Return the status and the output of a command on two files."""
    output = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True)
    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder, "a.xml"), Path(folder, "b.xml")]
        for file, text in zip(files, texts, strict=True):
            file.write_text(text, encoding="utf-8")
        words = [str(Path(folder, word)) if word.endswith(".xml") else word for word in command.split()]
        with contextlib.redirect_stdout(output), contextlib.redirect_stderr(output):
            status = main(words)
    return status, output.buffer.getvalue().decode()


def trees_of(tag):
    """Return a file with a tree for each combination of up to three known and unknown children of a node."""
    lists = (each for count in range(4) for each in itertools.product(CHILDREN, repeat=count))
    attributes = "".join(
        f" {name}={quoteattr(text)}" for name, text in required_values(REGISTRY.variants(tag)[0]).items()
    )
    trees = (f"<{tag}{attributes}>{''.join(children)}</{tag}>" for children in lists)
    numbered = (f'<BehaviorTree ID="T{number}">{tree}</BehaviorTree>' for number, tree in enumerate(trees))
    return '<root BTCPP_format="4">\n' + "\n".join(numbered) + "</root>\n"


@pytest.mark.parametrize("tag", sorted({spec.tag for spec in PARENTS}))
def test_no_rule_crashes_on_unknown_or_missing_children(tag):
    findings = check(Forest.from_file(parse_xml(trees_of(tag))), REGISTRY)
    assert [each.message for each in findings if each.code == "internal-error"] == []


@settings(max_examples=rounds(75))
@given(wrong_tree_texts())
def test_no_rule_crashes_on_invalid_tree(text):
    findings = check(Forest.from_file(parse_xml(text)), REGISTRY)
    assert [each.message for each in findings if each.code == "internal-error"] == []
    assert all(each.render() for each in findings)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_on_invalid_tree_ends_with_status_and_output(command):
    @settings(max_examples=rounds(10))
    @given(st.tuples(wrong_tree_texts(), wrong_tree_texts() | tree_texts()))
    def looks(texts):
        status, output = answer(command, texts)
        assert status in (0, 1, 2)
        assert output or status == 0

    looks()

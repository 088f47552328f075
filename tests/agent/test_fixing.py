"""Tests of `validate --print-fixed`, and of the benchmark of fixes."""

import pytest

from benchmarks.fixing import fixed as fixed_typo
from benchmarks.fixing import typos
from sar_compiler.tree.diagnostic import Form
from tests.cli.command_runner import run
from tests.trees import document

FIXES = {
    "a tag without content": ("<NavigateToZne/>", "<NavigateToZone/>"),
    "a tag with an end tag": ("<NavigateToZne></NavigateToZne >", "<NavigateToZone></NavigateToZone >"),
    "a tag around others, in it again": (
        '<Sequnce name="a>b"><!-- </Sequnce> --><Sequnce><Success/><![CDATA[</x>]]></Sequnce><Failure/></Sequnce>',
        '<Sequence name="a>b"><!-- </Sequnce> --><Sequence><Success/><![CDATA[</x>]]></Sequence><Failure/></Sequence>',
    ),
    "a tag and an attribute": (
        '<Retry num_failure="2"><NavigateToZne/></Retry>',
        '<Retry num_failures="2"><NavigateToZone/></Retry>',
    ),
    "a reference": (
        '<Sequence><DetectSurvivor/><NotifyBase detect_node="DetectSurvivr"/></Sequence>',
        '<Sequence><DetectSurvivor/><NotifyBase detect_node="DetectSurvivor"/></Sequence>',
    ),
}


def print_fixed(tmp_path, capsys, text, name="tree.xml"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    status, said, _ = run(capsys, "validate", "--print-fixed", path)
    assert path.read_text(encoding="utf-8") == text, "nothing is written"
    return status, said


@pytest.mark.parametrize("name", FIXES)
def test_every_suggestion_is_applied_at_all_its_locations(name, tmp_path, capsys):
    wrong, right = FIXES[name]
    assert print_fixed(tmp_path, capsys, document(wrong)) == (0, document(right))


def test_error_without_suggestion_stays_with_error_status(tmp_path, capsys):
    text = document('<Sequence memroy="true"><Xyzzy/><Success/></Sequence>')
    assert print_fixed(tmp_path, capsys, text) == (1, text.replace("memroy", "memory"))


def test_malformed_xml_is_printed_unchanged(tmp_path, capsys):
    assert print_fixed(tmp_path, capsys, "<root") == (1, "<root")


def test_yaml_file_is_fixed(tmp_path, capsys):
    text = "root:\n  BTCPP_format: 4\n  children:\n    - BehaviorTree:\n        ID: Main\n        children:\n          - Succes\n"
    assert print_fixed(tmp_path, capsys, text, "tree.yaml") == (0, text.replace("Succes", "Success"))


@pytest.mark.parametrize("more", [["other.xml"], ["--fix"]])
def test_print_fixed_refuses_several_files_and_fix_option(more, tmp_path, capsys):
    path = tmp_path / "tree.xml"
    path.write_text(document("<Succes/>"), encoding="utf-8")
    status, _, said = run(capsys, "validate", "--print-fixed", path, *more)
    assert (status, "--print-fixed prints a single file" in said) == (2, True)
    assert path.read_text(encoding="utf-8") == document("<Succes/>")


def test_benchmark_typos_are_reproducible_and_cover_xml_and_yaml():
    made = list(typos(12))
    assert made == list(typos(12))
    assert {each.form for each in made} == {Form.XML, Form.YAML}
    assert all(each.right != each.wrong for each in made)


def test_benchmark_distinguishes_fixed_from_unfixed_typos(tmp_path):
    each = next(each for each in typos(50) if each.where == "tag" and each.form is Form.XML)
    alone = each._replace(right=document("<Success/>"), wrong=document("<Succes/>"))
    assert fixed_typo(alone, tmp_path, lambda _finding: True) == (True, False)
    assert fixed_typo(alone, tmp_path, lambda _finding: False) == (False, True)

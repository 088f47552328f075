"""Tests that any random tree is compiled or reported."""

from hypothesis import given, settings

from sar_compiler.checks import check
from sar_compiler.compiler import bind_main, compile_tree, preview_tree
from sar_compiler.runtime.context import preview_of
from sar_compiler.tree.diagnostic import TreeError
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.xml import parse_xml
from tests.fuzz.random_trees import REGISTRY, tree_texts
from tests.random_inputs import rounds


def is_location_in_text(finding):
    span, text = finding.span, finding.source.text
    lines = text.split("\n")
    return (
        1 <= span.line <= span.end_line <= len(lines)
        and 1 <= span.column <= len(lines[span.line - 1]) + 1
        and (span.line, span.column) <= (span.end_line, span.end_column)
    )


def result_or_codes(make):
    """Return the result, or the codes of the findings that were raised."""
    try:
        return make(), []
    except TreeError as error:
        return None, [finding.code for finding in error.findings]


@settings(max_examples=rounds(75))
@given(tree_texts())
def test_findings_are_ordered_unique_and_located_in_text(text):
    findings = check(Forest.from_file(parse_xml(text)), REGISTRY)
    assert all(is_location_in_text(finding) and finding.message for finding in findings)
    assert "internal-error" not in {finding.code for finding in findings}
    assert len(set(findings)) == len(findings)
    assert [f.span.line for f in findings] == sorted(f.span.line for f in findings)


@settings(max_examples=rounds(75))
@given(tree_texts())
def test_tree_without_findings_can_be_previewed(text):
    forest = Forest.from_file(parse_xml(text))
    if check(forest, REGISTRY):
        return
    tree = preview_tree(bind_main(forest, REGISTRY))
    assert all(node.id in tree.origins for node in tree.root.iterate())


@settings(max_examples=rounds(75))
@given(tree_texts())
def test_compiling_raises_only_tree_errors(text):
    forest = Forest.from_file(parse_xml(text))

    def compile_for_run():
        binding = bind_main(forest, REGISTRY)
        context = {
            parameter.target: preview_of(parameter.target)
            for bound in binding.all_nodes()
            for parameter in bound.spec.handed_over
            if parameter.target is not None
        }
        return compile_tree(binding, context, {"a": 1, "c": "x"})

    tree, codes = result_or_codes(compile_for_run)
    assert (tree is None) == bool(codes)

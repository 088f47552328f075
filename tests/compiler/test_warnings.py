"""Tests of severities: only errors prevent a tree from being compiled."""

from dataclasses import replace

import pytest

from sar_compiler.compiler import bind_main, preview_tree
from sar_compiler.nodes.registry import default_registry
from sar_compiler.tree.diagnostic import Diagnostic, Severity, TreeError
from tests.trees import forest


def finding_in(tree, severity):
    return Diagnostic("schema", "perhaps", tree.main.source, tree.main.root.tag_span(), severity=severity)


@pytest.mark.parametrize("severity", [Severity.WARNING, Severity.INFO])
def test_tree_with_warnings_is_bound_and_compiled(severity):
    tree = forest("<Success/>")
    binding = bind_main(replace(tree, findings=(finding_in(tree, severity),)), default_registry())
    warned = replace(binding, findings=(finding_in(tree, severity),))
    assert preview_tree(warned).root.name == "Success"


def test_tree_with_error_is_not_bound_or_compiled():
    tree = forest("<Success/>")
    binding = bind_main(tree, default_registry())
    with pytest.raises(TreeError, match="perhaps"):
        bind_main(replace(tree, findings=(finding_in(tree, Severity.ERROR),)), default_registry())
    with pytest.raises(TreeError, match="perhaps"):
        preview_tree(replace(binding, findings=(finding_in(tree, Severity.ERROR),)))

"""What is only warned of does not keep a tree from being made."""

from dataclasses import replace

import pytest

from sar_compiler.compiler import bind_main, preview_tree
from sar_compiler.nodes.registry import default_registry
from sar_compiler.tree.diagnostic import Diagnostic, Severity, TreeError
from tests.trees import forest


def found(tree, severity):
    return Diagnostic("schema", "perhaps", tree.main.source, tree.main.root.tag_span(), severity=severity)


@pytest.mark.parametrize("severity", [Severity.WARNING, Severity.INFO])
def test_a_tree_with_nothing_but_warnings_is_bound_and_made(severity):
    tree = forest("<Success/>")
    binding = bind_main(replace(tree, findings=(found(tree, severity),)), default_registry())
    warned = replace(binding, findings=(found(tree, severity),))
    assert preview_tree(warned).root.name == "Success"


def test_a_tree_with_an_error_is_neither():
    tree = forest("<Success/>")
    binding = bind_main(tree, default_registry())
    with pytest.raises(TreeError, match="perhaps"):
        bind_main(replace(tree, findings=(found(tree, Severity.ERROR),)), default_registry())
    with pytest.raises(TreeError, match="perhaps"):
        preview_tree(replace(binding, findings=(found(tree, Severity.ERROR),)))

"""Tests of plain trees: their text shows that no script raises an error, so their runs are not tried."""

import random
import subprocess
import sys

import pytest

from sar_compiler.analysis.bounded_search import SearchBudget
from sar_compiler.analysis.proofs import try_runs
from sar_compiler.analysis.trial import is_plain
from sar_compiler.budget import WORK
from sar_compiler.loaded_tree import load
from tests.random_inputs import rounds
from tests.trees import document


def load_body(tmp_path, body):
    path = tmp_path / "t.xml"
    path.write_text(document(body), encoding="utf-8")
    return load(path)


def is_plain_tree(tree):
    (bound,) = tree.context.bound_forest.trees
    return is_plain(bound)


PLAIN = [
    '<Script code="a := 1"/>',
    '<Sequence><Script code="a := 1"/><ScriptCondition code="a == 1"/></Sequence>',
    "<Sequence><Script code=\"a := 'x'\"/><Inverter><ScriptCondition code=\"a != 'y'\"/></Inverter></Sequence>",
    '<Sequence><Sequence><Script code="a := 1"/></Sequence><Fallback><ScriptCondition code="0 &lt; a &lt;= 2.5"/><AlwaysSuccess/></Fallback></Sequence>',
    '<Sequence><Script code="a := 1"/><Script code="b := a"/><ScriptCondition code="a == b"/></Sequence>',
]
OTHERS = [
    '<ScriptCondition code="a == 1"/>',
    '<Sequence><ScriptCondition code="a == 1"/><Script code="a := 1"/></Sequence>',
    '<Fallback><Script code="a := 1"/><ScriptCondition code="a == 1"/></Fallback>',
    '<Sequence><Fallback><AlwaysSuccess/><Script code="a := 1"/></Fallback><ScriptCondition code="a == 1"/></Sequence>',
    '<Sequence><Script code="a := 1"/><ScriptCondition code="a == \'x\'"/></Sequence>',
    '<Sequence><Script code="a := 1"/><Script code="a := \'x\'"/></Sequence>',
    "<Sequence><Script code=\"a := 'x'\"/><ScriptCondition code=\"a &lt; 'y'\"/></Sequence>",
    '<Sequence><Script code="a := 1"/><Script code="b := 1 / a"/></Sequence>',
    '<Script code="a = 1"/>',
    '<AlwaysSuccess _onSuccess="a := 1"/>',
    '<Sequence><Script code="a := 1"/><SetBlackboard value="x" output_key="a"/><ScriptCondition code="a == 1"/></Sequence>',
    '<RetryUntilSuccessful num_attempts="-1"><Sequence><Script code="a := 1"/><ScriptCondition code="a == 2"/></Sequence></RetryUntilSuccessful>',
]


@pytest.mark.parametrize("body", PLAIN)
def test_tree_that_assigns_before_comparing_is_plain(body, tmp_path):
    assert is_plain_tree(load_body(tmp_path, body))


@pytest.mark.parametrize("body", OTHERS)
def test_tree_with_possible_error_is_not_plain(body, tmp_path):
    assert not is_plain_tree(load_body(tmp_path, body))


def random_body(chance, depth=0):
    if depth == 3 or chance.random() < 0.45:
        name, value = chance.choice("ab"), chance.choice(("1", "2.5", "'x'", "a", "b"))
        code = (
            f"{name} := {value}"
            if chance.random() < 0.6
            else f"{name} {chance.choice(('==', '!=', '&lt;'))} {value}"
        )
        return f'<Script code="{code}"/>' if ":=" in code else f'<ScriptCondition code="{code}"/>'
    tag = chance.choice(
        (
            "Sequence",
            "Sequence",
            "Sequence",
            "Fallback",
            "ReactiveSequence",
            "ParallelAll",
            "Inverter",
            "ForceSuccess",
        )
    )
    count = 1 if tag in ("Inverter", "ForceSuccess") else chance.randint(2, 3)
    return f"<{tag}>{''.join(random_body(chance, depth + 1) for _ in range(count))}</{tag}>"


def test_no_run_of_plain_tree_raises(tmp_path):
    chance, count = random.Random(1), 0  # noqa: S311
    for _ in range(rounds(150)):
        tree = load_body(tmp_path, f'<Sequence><Script code="a := 1"/>{random_body(chance)}</Sequence>')
        if is_plain_tree(tree):
            count += 1
            binding = tree.binding()
            assert try_runs(tree, binding, SearchBudget(WORK), "verify") == []
    assert count > 20


def test_plain_tree_is_checked_without_importing_simulation(tmp_path):
    path = tmp_path / "t.xml"
    path.write_text(document(PLAIN[1]), encoding="utf-8")
    program = (
        "import sys; from sar_compiler.cli.compile import main; "
        f"main(['validate', '--no-cache', {str(path)!r}]); print(*sys.modules, file=sys.stderr)"
    )
    done = subprocess.run(
        [sys.executable, "-S", "-c", f"import site; site.main(); {program}"],
        capture_output=True,
        text=True,
        check=True,
    )
    imported = done.stderr.splitlines()[-1].split()
    assert "sar_compiler.checks" in imported
    assert {"py_trees", "yaml", "sar_compiler.analysis.verify", "sar_compiler.compiler"}.isdisjoint(imported)

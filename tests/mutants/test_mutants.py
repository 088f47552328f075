"""Tests of the mutation tool with a module of a few lines and its test."""

import ast
from contextlib import closing

import pytest

from tests.mutants.__main__ import all_mutants, draw, survivors_of
from tests.mutants.mutating import mutants_of
from tests.mutants.running import Bench

pytestmark = pytest.mark.costly

MODULE = '''"""A module."""
LIMIT = 3
SPARE = 7

def is_late(ticks):
    """Return whether it is late."""
    return ticks > LIMIT
'''

TEST = """
import pathlib
import subprocess
import sys

import pytest

from toy import is_late

@pytest.fixture(scope="module")
def answer():
    command = "import toy; print(toy.is_late(9))"
    return subprocess.run([sys.executable, "-c", command], capture_output=True, text=True).stdout

def test_the_fourth_tick_is_late():
    assert is_late(4)
    assert not is_late(3)

def test_one_that_fails_from_the_second_time_on_kills_no_mutant():
    assert not is_late(0)
    first = pathlib.Path(__file__).with_name("ran")
    assert not first.exists()
    first.touch()

def test_another_process_says_something(answer):
    assert answer

def test_another_process_answers(answer):
    assert answer == "True\\n"
"""


def changes(source):
    return [
        mutant.change for mutant in mutants_of("m.py", source.encode()) if mutant.is_python(source.encode())
    ]


def checkout_of(root, module, test):
    (root / "toy").mkdir(parents=True)
    (root / "tests").mkdir()
    (root / "toy" / "__init__.py").write_text(module)
    (root / "tests" / "test_toy.py").write_text(test)
    return root


def test_detected_mutant_is_killed_and_undetected_one_survives(tmp_path, capsys):
    checkout = checkout_of(tmp_path / "checkout", MODULE, TEST)
    with closing(Bench(checkout, ["toy"], tmp_path / "cache")) as bench:
        mutants = all_mutants(checkout, ["toy"])
        (survivor,) = survivors_of(bench, mutants)
        # Tests that call the function directly, in a process, or in a fixture.
        assert {test.partition("::")[2] for test in bench.reaching(mutants[-1])} == {
            "test_the_fourth_tick_is_late",
            "test_another_process_says_something",
            "test_another_process_answers",
        }
    assert survivor.change == "7 -> 8"
    told = capsys.readouterr().out
    assert "toy/__init__.py:2: 3 -> 4: killed by tests/test_toy.py::test_the_fourth_tick_is_late" in told
    assert "toy/__init__.py:3: 7 -> 8: SURVIVED" in told
    assert "toy/__init__.py:7: > -> >=: killed by" in told
    # The checkout itself is not changed.
    assert (checkout / "toy" / "__init__.py").read_text() == MODULE
    assert sorted(path.name for path in checkout.rglob("*")) == ["__init__.py", "test_toy.py", "tests", "toy"]


def test_endless_mutant_is_killed(tmp_path, monkeypatch):
    monkeypatch.setattr("tests.mutants.running._START_SEC", 5.0)
    module = "def wait(n):\n    while n != 2:\n        n += 2\n"
    checkout = checkout_of(
        tmp_path / "checkout", module, "from toy import wait\ndef test_end():\n    wait(0)\n"
    )
    (endless, *_) = [mutant for mutant in all_mutants(checkout, ["toy"]) if mutant.change == "2 -> 3"]
    with closing(Bench(checkout, ["toy"], tmp_path / "cache")) as bench:
        assert bench.killer_of(endless)


def test_suite_that_checks_its_environment_is_measured_in_one_run(tmp_path):
    runs = tmp_path / "runs"
    test = f"def test_seven():\n    with open({str(runs)!r}, 'a') as file:\n        file.write('.')\n"
    checkout = checkout_of(tmp_path / "checkout", "def seven():\n    return 7\n", test)
    (checkout / "tests" / "conftest.py").write_text(
        "import os\nimport pytest\nBEFORE = {**os.environ}\n"
        "@pytest.hookimpl(wrapper=True)\ndef pytest_runtest_teardown():\n    yield\n"
        "    assert os.environ.keys() - BEFORE.keys() <= {'PYTEST_CURRENT_TEST'}\n"
    )
    with closing(Bench(checkout, ["toy"], tmp_path / "cache")):
        assert runs.read_text() == "."


def test_flaky_test_kills_no_mutant(tmp_path):
    times = tmp_path / "times"
    times.write_text("", encoding="utf-8")
    # The first run is without a mutant, the second with it.
    fails_once = (
        "from pathlib import Path\nfrom toy import seven\ndef test_now_and_then():\n    seven()\n"
        f"    times = Path({str(times)!r})\n    times.write_text(times.read_text() + '.')\n"
        "    assert times.read_text() != '..'\n"
    )
    checkout = checkout_of(tmp_path / "checkout", "def seven():\n    return 7\n", fails_once)
    (mutant,) = all_mutants(checkout, ["toy"])
    with closing(Bench(checkout, ["toy"], tmp_path / "cache")) as bench:
        assert bench.killer_of(mutant) == ""
    assert len(times.read_text()) > len("..")


def test_every_drawn_mutant_is_valid_and_changes_the_source(tmp_path):
    checkout = checkout_of(tmp_path, f"IS_SLOW = not(False)\n{MODULE}", TEST)
    source = (checkout / "toy" / "__init__.py").read_bytes()
    mutants = all_mutants(checkout, ["toy"])
    drawn = draw(checkout, mutants, 1, 0)
    assert len(drawn) < len(mutants)
    for mutant in drawn:
        assert mutant.applied(source) != source
        ast.parse(mutant.applied(source))
    assert draw(checkout, mutants, 1, 2) == drawn[:2]


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("x = a < b", ["< -> <="]),
        ("x = (a is\n not b)", ["is not -> is"]),
        ("x = a and (b or c)", ["and -> or", "or -> and"]),
        ("x = not a", ["not -> (nothing)"]),
        ("x = a | b", ["| -> &"]),
        ("x = True", ["True -> False"]),
        ("x = 'warning'", ["'warning' -> 'warningx'"]),
        ("x = {a, b}", ["a, -> (nothing)", ", b -> (nothing)"]),
        ("x = (a, b)", ["a, b -> a,", "a, b -> b,"]),
        ("x = {a: b}", ["a: b -> (nothing)"]),
        ("x = f(g, h=i)", [", h=i -> (nothing)"]),
        ("x = adding(R); y = S", ["R -> S", "S -> R"]),
        ("x = Skips.ALWAYS; y = Skips.NEVER", ["Skips.ALWAYS -> Skips.NEVER", "Skips.NEVER -> Skips.ALWAYS"]),
        ("x = f()\ndef f():\n    return g(h=i)", ["h=i -> (nothing)"]),
    ],
)
def test_each_kind_of_code_is_mutated(source, expected):
    assert changes(source) == expected


@pytest.mark.parametrize(
    "source",
    [
        '"""A docstring."""',
        "def f():\n    '''doc'''",
        "x = 'a message for people'",
        "x = 'Succeeds.'",
        "x = f'{a == 1} {b}'",
        "x: 'Literal[1]'",
        "def f(x: 'int' = a) -> 'int':\n    return x",
        "X: TypeAlias = 'int | str'",
        "x = cast('int', a)",
        "__all__ = ['a']",
        "class Way(Enum):\n    UP = 'up'",
        "if TYPE_CHECKING:\n    x = 1",
        "a, b = b, a",
        "def f():\n    return g(h=i)",
    ],
)
def test_text_for_people_and_type_checkers_is_not_mutated(source):
    assert changes(source) == []

"""Tests of the checks of leaf classes by their source, without ROS and without an instance."""

import importlib
import os
import sys
from pathlib import Path
from typing import Any

import pytest

from sar_compiler.checks.leaf_classes import check_class
from sar_compiler.nodes.spec import MARK, RegistrationError
from sar_compiler.tree.diagnostic import Diagnostic, Severity

HEAD = """from typing import Any
from py_trees.behaviour import Behaviour
from py_trees.common import Access, Status
from sar_compiler.leaves import ActionLeaf, Input, Kind, ServiceLeaf, TopicLeaf, Use, register

"""
GRIP = (
    HEAD
    + """
@register("Grip", kind=Kind.ACTION, outcomes=set(Status) - {Status.INVALID}, uses=[Use.action("grip")])
class Grip(ActionLeaf):
    action_type = "my_msgs/action/Grip"
    action_name = "grip"

    def __init__(self, name: str, width: Input[float]) -> None:
        super().__init__(name)
        self._width = width

    def goal(self) -> Any:
        return self.interface.Goal(width=self._width.get())
"""
)
TALLY = (
    HEAD
    + """
@register("Tally", kind=Kind.ACTION, outcomes={Status.SUCCESS}, writes=["count"])
class Tally(Behaviour):
    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.board = self.attach_blackboard_client()
        self.board.register_key(key="count", access=Access.WRITE)
        self.board.register_key(key="step", access=Access.READ)

    def update(self) -> Status:
        self.board.count += self.board.step
        return Status.SUCCESS
"""
)


@pytest.fixture
def findings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return a function that checks the class registered by a module with the given text."""

    def check(text: str) -> list[Diagnostic]:
        (tmp_path / "written_leaf.py").write_text(text, encoding="utf-8")
        monkeypatch.syspath_prepend(str(tmp_path))
        monkeypatch.delitem(sys.modules, "written_leaf", raising=False)
        importlib.invalidate_caches()
        module = importlib.import_module("written_leaf")
        [cls] = [each for each in vars(module).values() if isinstance(each, type) and MARK in vars(each)]
        return list(check_class(vars(cls)[MARK]))

    return check


@pytest.mark.parametrize("text", [GRIP, TALLY])
def test_class_that_matches_its_declaration_has_no_findings(findings: Any, text: str) -> None:
    assert findings(text) == []


WRONG = {
    "an attribute that hides a method": (
        GRIP.replace("self._width = width", "self.goal = width").replace("self._width", "self.goal"),
        "faulty-class",
        "self.goal",
        "hides the method 'goal' of Grip",
    ),
    "an attribute that hides a method of a base": (
        GRIP.replace("self._width = width", "self._width = self.on_result = width"),
        "faulty-class",
        "self.on_result",
        "hides the method 'on_result' of ActionLeaf",
    ),
    "a property without a setter": (
        GRIP.replace("self._width = width", "self._width, self.interface = width, None"),
        "faulty-class",
        "self.interface",
        "'interface' is a read-only property of ClientLeaf",
    ),
    "a missing type": (
        GRIP.replace('    action_type = "my_msgs/action/Grip"\n', ""),
        "faulty-class",
        "class Grip",
        "has no 'action_type'",
    ),
    "a missing name": (
        GRIP.replace('    action_name = "grip"\n', ""),
        "faulty-class",
        "class Grip",
        "has no 'action_name'",
    ),
    "a server that is not declared": (
        GRIP.replace(', uses=[Use.action("grip")]', ""),
        "undeclared-in-class",
        "register(",
        "needs the action 'grip'",
    ),
    "a use of another kind": (
        GRIP.replace("Use.action", "Use.topic"),
        "undeclared-in-class",
        "register(",
        "needs the action 'grip'",
    ),
    "an outcome that is not declared": (
        TALLY.replace("return Status.SUCCESS", "return Status.FAILURE"),
        "undeclared-in-class",
        "Status.FAILURE",
        "update() returns FAILURE",
    ),
    "a key that is not declared": (
        TALLY.replace(', writes=["count"]', ""),
        "undeclared-in-class",
        'self.board.register_key(key="count"',
        "writes the key 'count'",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_error_in_class_is_found_at_its_line(findings: Any, case: str) -> None:
    text, code, place, message = WRONG[case]
    [finding] = findings(text)
    assert (finding.code, finding.source.path.endswith("written_leaf.py")) == (code, True)
    assert message in finding.message
    assert text.splitlines()[finding.span.line - 1][finding.span.column - 1 :].startswith(place)
    assert finding.severity is (Severity.ERROR if code == "faulty-class" else Severity.WARNING)


SET_ELSEWHERE = {
    "in the constructor": GRIP.replace('    action_name = "grip"\n', "").replace(
        "self._width = width", "self._width, self.action_name = width, name"
    ),
    "in a base class": GRIP.replace(
        "\n@register", "\nclass Base(ActionLeaf):\n    action_type = 'a/action/B'\n\n\n@register"
    )
    .replace("class Grip(ActionLeaf)", "class Grip(Base)")
    .replace('    action_type = "my_msgs/action/Grip"\n', ""),
}


@pytest.mark.parametrize("case", SET_ELSEWHERE)
def test_attribute_may_be_set_in_constructor_or_base_class(findings: Any, case: str) -> None:
    assert findings(SET_ELSEWHERE[case]) == []


@pytest.mark.parametrize("value", ["lambda: None", "functools.partial(print, width)", "self.other", "width"])
def test_method_may_be_replaced_by_function(findings: Any, value: str) -> None:
    text = GRIP.replace("self._width = width", f"self._width = width\n        self.nav2_reason = {value}")
    text = text.replace(
        "width: Input[float]",
        "width: 'typing.Callable[[], str]'" if value == "width" else "width: Input[float]",
    )
    assert "faulty-class" not in [each.code for each in findings_of_source(findings, text)]


def findings_of_source(findings: Any, text: str) -> list[Diagnostic]:
    """Return the findings about a class whose module needs further imports."""
    return list(findings(f"import functools\nimport typing\n{text}"))


def test_leaf_that_uses_nav2_need_not_declare_its_action(findings: Any) -> None:
    assert findings(GRIP.replace('Use.action("grip")', "Use.nav2()")) == []


@pytest.mark.parametrize("decorator", ["@register", '@register("Bare")'])
def test_registration_without_kind_suggests_complete_call(findings: Any, decorator: str) -> None:
    with pytest.raises(RegistrationError, match=r'write @register\("Bare", kind=Kind\.ACTION\)'):
        findings(f"{HEAD}\n{decorator}\nclass Bare(Behaviour):\n    pass\n")


def test_module_whose_file_is_replaced_by_pipe_after_import_is_skipped(findings: Any, tmp_path: Path) -> None:
    assert findings(WRONG["a missing type"][0]) != []
    path = tmp_path / "written_leaf.py"
    cls = sys.modules["written_leaf"].Grip
    path.unlink()
    os.mkfifo(path)
    assert list(check_class(vars(cls)[MARK])) == []


def test_shipped_leaves_have_no_findings() -> None:
    from sar_compiler.nodes.registry import default_registry

    assert [finding for spec in default_registry() for finding in check_class(spec)] == []

"""Tests of nodes whose classes are named by import path: their declarations must match the classes."""

import dataclasses
import inspect
import subprocess
import sys
import typing
from enum import Enum
from pathlib import Path
from typing import Annotated, Literal

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.nodes.declared import UndeclarableError, declared_leaves, specs_as_json
from sar_compiler.nodes.declaring import attribute, input_port, signature
from sar_compiler.nodes.language import SPECS
from sar_compiler.nodes.nav2 import VERSIONS, specs
from sar_compiler.nodes.register import register
from sar_compiler.nodes.registry import Registry, RegistryError, load_registry, registered_leaves
from sar_compiler.nodes.spec import Direction, Kind, NodeSpec, ParameterRole, Signature, Use, load
from sar_compiler.nodes.values import Seconds, at_least, plausible_number, strip_none
from sar_compiler.runtime.blackboard import Scope
from sar_compiler.runtime.clock import Clock, ManualClock
from sar_compiler.runtime.expressions import Script
from sar_compiler.runtime.outcomes import Outcome
from sar_compiler.runtime.ports import InOut, Input, Output
from sar_compiler.runtime.variables import Enums
from search_and_rescue import SPECS as LEAVES
from tests.runtime.stage import Stage
from tests.trees import class_of

MISSION = "search_and_rescue"
LANGUAGE = [*SPECS, *(spec for version in VERSIONS for spec in specs(version) if spec.is_by_path)]
DECLARED = {f"{spec.tag} of {spec.factory_path}": spec for spec in LANGUAGE}
VARIADIC = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
GIVEN = (ParameterRole.ATTRIBUTE, ParameterRole.CONTEXT)
PORTS = {Direction.INPUT: Input, Direction.OUTPUT: Output, Direction.INOUT: InOut}
KERNEL = "sar_compiler.runtime.kernel."
OF_KERNEL = {name: spec for name, spec in DECLARED.items() if spec.class_path.startswith(KERNEL)}
OTHERS = {name: spec for name, spec in DECLARED.items() if name not in OF_KERNEL}
every_other_node = pytest.mark.parametrize("spec", OTHERS.values(), ids=OTHERS)
every_declared_node = pytest.mark.parametrize("spec", DECLARED.values(), ids=DECLARED)


def output_and_imports_of(*arguments, folder=Path()):
    """Run `sar-compile` in a process of its own, and return its output and the modules that it imported."""
    program = (
        "import sys; from sar_compiler.cli.compile import main; status = main(sys.argv[1:]); "
        "print(*sorted(sys.modules), file=sys.stderr); sys.exit(status)"
    )
    command = [sys.executable, "-c", program, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=folder)
    return done.stdout, set(done.stderr.split())


def is_stock(spec):
    """Return whether a node is created by py_trees' constructor, from values converted from its attributes."""
    return spec.signature.factory.endswith(":stock")


def constructor_parameters(spec):
    """Return the parameters of the function or class that creates a node, and their annotations, by name."""
    maker = spec.cls if is_stock(spec) else load(spec.factory_path)
    hints = typing.get_type_hints(maker.__init__ if isinstance(maker, type) else maker)  # type: ignore[misc]
    plain = [
        each
        for each in inspect.signature(maker).parameters.values()
        if each.kind not in VARIADIC and each.annotation is not NodeSpec
    ]
    return {each.name: each for each in plain}, {
        each.name: strip_none(hints.get(each.name)) for each in plain
    }


@every_other_node
def test_declared_parameters_match_constructor(spec):
    taken, hints = constructor_parameters(spec)
    declared = {
        parameter.keyword or name: parameter
        for name, parameter in spec.parameters.items()
        if not (is_stock(spec) and parameter.role is ParameterRole.CONTEXT)
    }
    assert declared.keys() <= taken.keys()
    for name, parameter in taken.items():
        assert name in declared or parameter.default is not inspect.Parameter.empty, name
    for name, parameter in declared.items():
        if parameter.direction is not None and not is_stock(spec):
            assert (typing.get_origin(hints[name]) or hints[name]) is PORTS[parameter.direction]
        if parameter.role in (ParameterRole.CONTEXT, ParameterRole.REFERENCE):
            assert parameter.target is hints[name]
        elif spec.kind.is_leaf and not (
            parameter.direction or parameter.required or name == "name" or is_stock(spec)
        ):
            assert parameter.default == taken[name].default, name


def sample_of(parameter, stage):
    """Return a valid argument for a parameter of a kernel node."""
    if parameter.role is ParameterRole.CONTEXT:
        return {Scope: stage.scope, Enums: stage.enums, Clock: ManualClock()}[parameter.target]
    if parameter.direction is Direction.OUTPUT:
        return Output(stage.entry("written"))
    if parameter.direction is Direction.INOUT:
        return InOut(stage.entry("place"))
    samples = {int: 1, float: 10.0, bool: True, str: "1", Script: stage.code("place > 0").get()}
    return Input(parameter.default or samples.get(parameter.value_type.python, "1"))


@pytest.mark.parametrize("spec", OF_KERNEL.values(), ids=OF_KERNEL)
def test_kernel_node_reads_every_declared_parameter(spec):
    read = set()
    for outcomes in ("S", "F", "R", "R,S", "S,R"):
        stage = Stage(place=0)
        leaves = [stage.leaf(name, outcomes) for name in "abcdefg"[: max(1, spec.child_count[0])]]
        below = [] if spec.kind.is_leaf else [leaves if spec.kind is Kind.CONTROL else leaves[0]]
        given = {
            p.keyword or p.name: sample_of(p, stage) for p in spec.parameters.values() if p.role in GIVEN
        }
        made = spec.maker("node", *below, **given)

        class Watched(type(made)):  # type: ignore[misc]
            def __getattribute__(self, name):
                read.add(name)
                return super().__getattribute__(name)

        made.__class__ = Watched
        for _ in range(4):
            made.tick_once()
        made.stop(Status.INVALID)
    assert {p.keyword or p.name for p in spec.parameters.values() if p.role in GIVEN} <= read


@every_other_node
def test_optional_attribute_has_default_of_constructor(spec):
    taken, _ = constructor_parameters(spec)
    for parameter in spec.attributes:
        default = taken[parameter.keyword or parameter.name].default
        if isinstance(default, Input):
            # The class has the default of a port that is not given. The spec may repeat it.
            default = default.get() if parameter.default is not None else None
        # A tag may require an attribute that is optional for its class.
        if (
            default not in (inspect.Parameter.empty, None)
            and not parameter.required
            and parameter.role is not ParameterRole.NAME
        ):
            assert parameter.default == default
        if parameter.direction is not None and not parameter.required:
            assert default is not inspect.Parameter.empty


def test_leaf_specs_file_matches_registered_leaves():
    text = specs_as_json(registered_leaves(MISSION))
    assert Path(MISSION, "leaf_specs.json").read_text(encoding="utf-8") == text, "renew it: make schemas"


class Speed(Enum):
    SLOW = 1


@register(
    "Whole",
    kind=Kind.ACTION,
    uses=[Use.topic("{topic}")],
    outcomes=[Outcome("SUCCESS", "done", "x > 0", "x = 0", p=(0.5, 1.0), sec=(1.0, 2.0), writes=("place",))],
    facts={"x": 1},
    reads=["a"],
    writes=["b"],
)
class Whole(Behaviour):
    """Have everything that can be declared.

    Args:
        topic: A topic.
        other: Another one.
        place: A port.
        numbers: Numbers.
        share: A share.
        tries: How often.
        how: How.
        wait: How long.
        clock: The clock.
    """

    def __init__(
        self,
        name: str,
        *,
        topic: str,
        other: "Whole",
        place: Output[float],
        numbers: Input[list[float]],
        share: Annotated[float, plausible_number(0)] = 0.5,
        tries: Annotated[int, at_least(2)] = 3,
        how: Literal["fast", "slow"] = "fast",
        wait: Seconds = 1.0,
        if_: bool = False,
        clock: Clock | None = None,
    ) -> None: ...


def test_leaf_spec_survives_round_trip_through_json(tmp_path):
    registry = Registry()
    registry.add_class(Whole)
    path = tmp_path / "leaf_specs.json"
    path.write_text(specs_as_json(registry), encoding="utf-8")
    (spec,), (read,) = registry, declared_leaves(path)

    def shown(each):
        parameters = [
            dataclasses.replace(
                one,
                value_type=one.value_type._replace(convert=str),
                target_or_path=one.target_path or None,
            )
            for one in each.parameters.values()
        ]
        return dataclasses.replace(
            each, class_or_path=each.class_path, signature=Signature(doc=each.doc)
        ), parameters

    assert shown(read) == shown(spec)
    for name in ("numbers", "share", "tries", "how", "wait"):
        text = spec.parameters[name].value_type.example
        converted = [each.parameters[name].value_type.convert(text) for each in (spec, read)]
        assert converted[0] == converted[1]


def test_parameter_type_without_json_form_is_rejected():
    @register("Fast", kind=Kind.ACTION)
    class Fast(Behaviour):
        def __init__(self, name: str, speed: Speed = Speed.SLOW) -> None: ...

    registry = Registry()
    registry.add_class(Fast)
    with pytest.raises(UndeclarableError, match="<Fast> cannot be written as JSON: the type 'Speed'"):
        specs_as_json(registry)


@every_declared_node
def test_replacement_class_for_skippable_children_can_be_imported(spec):
    if spec.skipping.replacement:
        assert isinstance(spec.skipping.replacement.cls, type)


@pytest.mark.parametrize("version", VERSIONS)
def test_stand_in_class_of_nav2_node_can_be_imported(version):
    for spec in specs(version):
        assert not spec.stand_in or isinstance(spec.stand_in.cls, type)


def test_no_declared_class_is_derived_from_referenced_class():
    declared = [*DECLARED.values(), *LEAVES]
    referred = {parameter.target for spec in declared for parameter in spec.references}
    derived = [
        (cls, target)
        for target in referred
        for cls in map(class_of, declared)
        if cls is not None and target is not None and cls is not target and issubclass(cls, target)
    ]
    assert referred
    assert derived == []


@pytest.mark.parametrize("of", ["search_and_rescue", "search_and_rescue_resilient"])
def test_validate_does_not_import_shipped_nodes(of):
    output, modules = output_and_imports_of("validate", of)
    assert "no findings" in output
    leaves = {spec.class_path.partition(":")[0] for spec in LEAVES}
    heavy = ("py_trees", "sar_compiler.ros", "sar_compiler.compiler", "importlib.metadata", "jsonschema")
    assert {name for name in modules if name.startswith(heavy) or name in leaves} == set()
    assert sum(name.startswith("sar_compiler") for name in modules) < 112


def test_validate_does_not_import_py_trees_for_language_nodes(tmp_path):
    tree = tmp_path / "tree.xml"
    tags = sorted({spec.tag for spec in SPECS} - {"SubTree"})
    inside = "".join(f"<{tag}/>" for tag in tags)
    tree.write_text(
        f'<root BTCPP_format="4"><BehaviorTree ID="A"><Sequence>{inside}</Sequence></BehaviorTree></root>'
    )
    output, modules = output_and_imports_of("validate", str(tree), folder=tmp_path)
    assert "missing-attribute" in output
    assert "py_trees" not in modules


def test_changed_leaf_module_is_read_again(tmp_path):
    leaf = tmp_path / "mine.py"
    source = (
        "from py_trees.behaviour import Behaviour\nfrom sar_compiler.leaves import Kind, register\n"
        "@register('Mine', kind=Kind.ACTION)\nclass Mine(Behaviour):\n"
        "    def __init__(self, name: str, {0}: int = 0) -> None: ...\n    def update(self): ...\n"
    )
    tree = tmp_path / "tree.xml"
    tree.write_text('<root BTCPP_format="4"><BehaviorTree ID="A"><Mine there="1"/></BehaviorTree></root>')
    found = []
    for name in ("here", "there", "here"):
        leaf.write_text(source.format(name))
        found.append(
            "unknown-attribute"
            in output_and_imports_of("validate", str(tree), "--nodes", "mine", folder=tmp_path)[0]
        )
    assert found == [True, False, True]


def test_installed_module_of_leaves_may_also_be_named():
    registry = load_registry([MISSION])
    assert len(registry.variants("NavigateToZone")) == 1


def test_tag_of_declared_class_cannot_be_registered_again():
    class Other:
        def __init__(self, name: str) -> None: ...

    registry = Registry(load_registry().specs())
    with pytest.raises(
        RegistryError, match=r"two classes are registered as <NavigateToZone>: .*NavigateToZone and .*Other"
    ):
        registry.add(NodeSpec("NavigateToZone", Other, Kind.ACTION))


def test_declared_parameter_has_annotated_type_and_name_without_underscore():
    signed = signature(
        Kind.DECORATOR, "Waits.", attribute("if_", int, "A."), input_port("rate", float, "B.", 2.5)
    )
    assert isinstance(signed.described, dict)
    assert list(signed.described) == ["name", "child", "if", "rate"]
    first, second = signed.described["if"], signed.described["rate"]
    assert (first.keyword, first.required, first.default) == ("if_", True, None)
    assert (second.keyword, second.required, second.default, second.direction) == (
        "",
        False,
        2.5,
        Direction.INPUT,
    )
    assert (first.value_type and first.value_type.name) == "integer"
    # A port accepts the same values as in BehaviorTree.CPP, including infinity.
    assert (second.value_type and second.value_type.name) == "real"

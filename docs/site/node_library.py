"""The node library: `python docs/site/node_library.py` in the project's folder writes `docs/reference/nodes/`, see `make schemas`.

The section of a node contains a table of its statuses, its attributes from the registry, an example, and the drawing and the first tick of the
example. The examples are executed.
"""

import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple
from xml.sax.saxutils import quoteattr

import sar_compiler
from sar_compiler.compiler.outline import add_tags, unicode_tree
from sar_compiler.nodes import nav2, ros_leaves
from sar_compiler.nodes.models.palette import value_text
from sar_compiler.nodes.registry import default_registry
from sar_compiler.nodes.spec import Kind, NodeSpec, Parameter, ParameterRole

FOLDER = Path(__file__).parents[1] / "reference/nodes"
STATUSES = ("Success", "Failure", "Running")
FAMILIES = {
    "controls": ("Controls", "A control has one or more children, and determines which child is ticked."),
    "decorators": ("Decorators", "A decorator has one child. It changes the child's status, or determines when the child is ticked."),
    "leaves": ("Leaves of the language", "These leaves need no robot: they execute scripts, use the blackboard, wait, or return a constant status."),
    "search-and-rescue": (
        "Leaves of search and rescue",
        "These leaves belong to the [search-and-rescue mission](../../missions/search-and-rescue.md).",
    ),
    "ros": (
        "Leaves for ROS",
        "These leaves call services and actions, and use topics and transforms, without Python. To use them, pass `--model ros:jazzy` to any command.",
    ),
    "nav2": (
        "Controls and decorators of Nav2",
        "Trees for Nav2 use these nodes. To use them, pass `--model nav2:jazzy`, `nav2:kilted` or `nav2:main` to any command.",
    ),
    "nav2-leaves": (
        "Leaves of Nav2",
        "Only Nav2 can execute these leaves. With `--model nav2:jazzy`, `nav2:kilted` or `nav2:main`, you can check, simulate and verify trees with them.",
    ),
}  # fmt: skip
"""The title and the introduction of each page of the library."""
FURTHER = {
    "ros": "[Leaves by attributes](../../how-to/leaves-by-attributes.md)",
    "nav2": "[Check Nav2's trees](../../how-to/nav2-trees.md)",
    "nav2-leaves": "[Check Nav2's trees](../../how-to/nav2-trees.md)",
}
"""The how-to page for the nodes of a page of the library."""
ATTRIBUTES = {
    "BlackboardToStatus": {"variable_name": "status"},
    "CheckBlackboardVariableExists": {"variable_name": "x"},
    "CheckBlackboardVariableValue": {"variable": "x", "operator": "gt", "value": "1"},
    "CheckBlackboardVariableValues": {"checks": "x gt 1; x lt 5", "operator": "and"},
    "CompareBlackboardVariables": {"var1_key": "x", "var2_key": "y", "operator": "lt"},
    "Condition": {"status": "SUCCESS"},
    "Delay": {"delay_msec": "1s"},
    "EternalGuard": {"condition": "x == 2"},
    "ForEach": {"source_key": "list", "target_key": "item"},
    "LoopBool": {"queue": "true;false", "value": "{item}"},
    "LoopDouble": {"queue": "0.5;1.5", "value": "{item}"},
    "LoopInt": {"queue": "1;2", "value": "{item}"},
    "LoopString": {"queue": "a;b", "value": "{item}"},
    "MissionTimeLeft": {"limit": "10min"},
    "OneShot": {"policy": "ON_COMPLETION"},
    "Periodic": {"n": "2"},
    "PersistentSequence": {"current_child_idx": "{child}"},
    "Precondition": {"if": "x == 2"},
    "Repeat": {"num_cycles": "2"},
    "Retry": {"num_failures": "2"},
    "RetryUntilSuccessful": {"num_attempts": "2"},
    "RosAction": {"action": "wait", "type": "nav2_msgs/action/Wait", "goal": "time: {sec: 5}"},
    "RosPublish": {"topic": "greeting", "type": "std_msgs/msg/String", "message": "data: hello"},
    "RosService": {"service": "light", "type": "std_srvs/srv/SetBool", "request": "data: true"},
    "RosTopic": {
        "topic": "battery_state",
        "type": "sensor_msgs/msg/BatteryState",
        "fields": "percentage: {battery}",
    },
    "RosTransform": {"target_frame": "map", "source_frame": "base_link", "x": "{x}", "y": "{y}"},
    "Script": {"code": "x := 2; y := x + 1"},
    "ScriptCondition": {"code": "x == 2"},
    "SetBlackboard": {"value": "5", "output_key": "x"},
    "SetBlackboardVariable": {"variable_name": "x", "variable_value": "5"},
    "SkipUnlessUpdated": {"entry": "{x}"},
    "Sleep": {"msec": "1s"},
    "StatusQueue": {"queue": "RUNNING;SUCCESS"},
    "StatusToBlackboard": {"variable_name": "x"},
    "SuccessEveryN": {"n": "2"},
    "TickCounter": {"duration": "2", "completion_status": "SUCCESS"},
    "Timeout": {"msec": "1s"},
    "UnsetBlackboard": {"key": "x"},
    "UnsetBlackboardVariable": {"key": "x"},
    "WaitForBlackboardVariable": {"variable_name": "x"},
    "WaitForBlackboardVariableValue": {"variable": "x", "operator": "eq", "value": "2"},
    "WaitValueUpdate": {"entry": "{x}"},
    "WasEntryUpdated": {"entry": "{x}"},
    **{
        f"Switch{n}": {"variable": "{x}", **{f"case_{each}": str(each) for each in range(1, n + 1)}}
        for n in range(2, 7)
    },
}
"""The attributes in the example of a node that needs attributes, by tag."""
BEFORE = {
    "ForEach": '<SetBlackboard value="json:[1, 2]" output_key="list"/>',
    "PersistentSequence": '<Script code="child := 0"/>',
    "BlackboardToStatus": '<StatusToBlackboard variable_name="status"><Success/></StatusToBlackboard>',
    "CompareBlackboardVariables": '<Script code="x := 2; y := 3"/>',
    **dict.fromkeys(
        (
            "IsSurvivorDetected",
            "BroadcastSurvivorTF",
            "NotifyBase",
            "KeepReport",
            "AwaitSurvivor",
            "IsFindNew",
        ),
        "<DetectSurvivor/>",
    ),
}
"""The node that must precede a node in its example, by tag; by default a Script, if the example reads `x`."""


class Shown(NamedTuple):
    """A node of the library: its spec, and the palettes that contain it. Its example uses the first palette."""

    spec: NodeSpec
    models: tuple[str, ...] = ()


def families() -> dict[str, list[Shown]]:
    """Return the nodes of each page."""
    found: dict[str, list[Shown]] = {name: [] for name in FAMILIES}
    for spec in default_registry():
        if not spec.variant:
            found[_family(spec)].append(Shown(spec))
    found["ros"] = [Shown(spec, ("ros:jazzy",)) for spec in ros_leaves.specs("jazzy")]
    by_tag: dict[str, Shown] = {}
    for version in reversed(nav2.VERSIONS):
        for spec in nav2.specs(version):
            newest, models = by_tag.get(spec.tag, Shown(spec))
            by_tag[spec.tag] = Shown(newest, (*models, f"nav2:{version}"))
    for _, shown in sorted(by_tag.items()):
        found["nav2-leaves" if shown.spec.kind.is_leaf else "nav2"].append(shown)
    return found


def pages() -> dict[Path, str]:
    """Return each page of the library, by its path."""
    nodes = families()
    made = {FOLDER / f"{name}.md": _page(name, shown) for name, shown in nodes.items()}
    rows = [
        f"- [{title}]({name}.md): "
        + ", ".join(f"[`{s.tag}`]({name}.md#{s.tag.lower()})" for s, _ in nodes[name])
        for name, (title, _) in FAMILIES.items()
    ]
    intro = (
        "A tree can use these nodes without Python classes of your own. Each node has a description with its statuses, its attributes, an example, and the example's drawing.\n"
        "For your own leaves, `sar-compile nodes TAG` prints statuses and attributes."
    )
    note = "`make schemas` executes the examples, and writes their statuses and results to these pages."
    made[FOLDER / "README.md"] = "\n\n".join(["# Node library", intro, "\n".join(rows), note]) + "\n"
    return made


def _family(spec: NodeSpec) -> str:
    if spec.class_path.startswith("search_and_rescue"):
        return "search-and-rescue"
    return {Kind.CONTROL: "controls", Kind.DECORATOR: "decorators"}.get(spec.kind, "leaves")


def _page(name: str, nodes: "list[Shown]") -> str:
    title, intro = FAMILIES[name]
    intro += f" See {FURTHER[name]}." if name in FURTHER else ""
    return "\n\n".join([f"# {title}", intro, *("\n\n".join(_section(shown)) for shown in nodes)]) + "\n"


def _section(shown: Shown) -> Iterator[str]:
    spec, models = shown
    yield f"## {spec.tag}"
    yield f"*{spec.kind.value}.* {spec.doc}".strip()
    if models and models[0] != "ros:jazzy" and len(models) < len(nav2.VERSIONS):
        yield f"Only in {' and '.join(f'`{model}`' for model in reversed(models))}."
    yield from _statuses(shown)
    yield from _attributes(spec)
    body = _example(spec)
    yield f"```xml\n{body}\n```"
    drawing, trace = _executed(body, models)
    yield f"```text\n{drawing}\n\n{trace}\n```"


def _statuses(shown: Shown) -> Iterator[str]:
    """Yield the statuses of a node: by the status of its child or its first two children, or the declared outcomes of a leaf."""
    spec = shown.spec
    if spec.kind.is_leaf:
        outcomes = [
            f"{each.status} (label `{each.label}`)" if each.label else each.status for each in spec.outcomes
        ]
        listed = ", ".join(outcomes[:-1])
        yield f"Returns {' or '.join(filter(None, (listed, *outcomes[-1:])))}."
    elif spec.kind is Kind.DECORATOR:
        rows = [f"| {each.upper()} | {_returned(shown, [each])} |" for each in STATUSES]
        yield "\n".join([f"| Child returns | {spec.tag} returns |", "|---|---|", *rows])
    elif not spec.tag.startswith("Switch"):  # the value of its variable chooses the child of a Switch
        heads = " | ".join(f"second {each.upper()}" for each in STATUSES)
        rows = [
            f"| first {one.upper()} | {' | '.join(_returned(shown, [one, two]) for two in STATUSES)} |" for one in STATUSES
        ]  # fmt: skip
        yield "\n".join([f"| Children return | {heads} |", "|---|---|---|---|", *rows])


def _attributes(spec: NodeSpec) -> Iterator[str]:
    items = [
        f"- `{each.name}` ({_type(each)}, {_default(each)}): {each.doc}"
        for each in spec.attributes
        if each.role is not ParameterRole.NAME and each.name not in spec.implied_values
    ]
    if items:
        yield "\n".join(["Attributes:\n", *items]).replace("<", "\\<")


def _type(parameter: Parameter) -> str:
    if parameter.role is ParameterRole.REFERENCE:
        return f"name of a {parameter.target_name}"
    direction = f"{parameter.direction.message_name.partition(',')[0]}, " if parameter.direction else ""
    return f"{direction}{parameter.value_type.label}"


def _default(parameter: Parameter) -> str:
    if parameter.role is ParameterRole.REFERENCE:
        return "default: the only one"
    if parameter.required:
        return "required"
    return "optional" if parameter.default is None else f"default `{value_text(parameter.default)}`"


def _node(spec: NodeSpec, children: "list[str]") -> str:
    written = "".join(f" {name}={quoteattr(value)}" for name, value in ATTRIBUTES.get(spec.tag, {}).items())
    if not children:
        return f"<{spec.tag}{written}/>"
    inside = "\n".join(f"  {line}" for child in children for line in child.splitlines())
    return f"<{spec.tag}{written}>\n{inside}\n</{spec.tag}>"


def _with_preparation(spec: NodeSpec, node: str) -> str:
    """Return the XML of a node, in a Sequence after the node that its example needs."""
    needs_x = "x" in {*ATTRIBUTES.get(spec.tag, {}).values()} or "x " in node or "{x}" in node
    writes_x = spec.tag in {"Script", "RosTransform"}
    before = BEFORE.get(spec.tag, '<Script code="x := 2"/>' if needs_x and not writes_x else "")
    if not before:
        return node
    inside = "\n".join(f"  {line}" for line in (before, *node.splitlines()))
    return f"<Sequence>\n{inside}\n</Sequence>"


def _example(spec: NodeSpec) -> str:
    count = 0 if spec.kind.is_leaf else max(spec.child_count[0], 2 if spec.kind is Kind.CONTROL else 1)
    leaves = ["<AlwaysFailure/>", "<AlwaysSuccess/>", *["<AlwaysFailure/>"] * count]
    return _with_preparation(spec, _node(spec, ["<AlwaysSuccess/>"] if count == 1 else leaves[:count]))


def _returned(shown: Shown, statuses: "list[str]") -> str:
    """Return the status of a node after the first tick in which its children return some statuses."""
    spec, models = shown
    _, run = _simulated(_with_preparation(spec, _node(spec, [f"<{each}/>" for each in statuses])), models)
    return str(run.tick(1).root)


def _executed(body: str, models: Sequence[str]) -> "tuple[str, str]":
    """Return the drawing of a tree, and its first tick."""
    tree, run = _simulated(body, models)
    ticks = [line for line in str(run.tick(1).trace).splitlines() if line.startswith(("tick", "  "))]
    return add_tags(unicode_tree(tree.root), tree).rstrip(), "\n".join(ticks)


def _simulated(body: str, models: Sequence[str]) -> "tuple[Any, Any]":
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "example.xml"
        inside = "\n".join(f"    {line}" for line in body.splitlines())
        path.write_text(
            f'<root BTCPP_format="4">\n  <BehaviorTree ID="Example">\n{inside}\n  </BehaviorTree>\n</root>\n'
        )
        loaded = sar_compiler.load(path, models=models[:1])
        if errors := [each.render() for each in loaded.check() if each.severity.value == "error"]:
            raise ValueError("\n".join(errors))
        return loaded.preview(), loaded.simulate()


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for page, text in pages().items():
        page.write_text(text, encoding="utf-8")

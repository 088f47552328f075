"""A process that ticks trees with another library; run by the Python that has it (see `peers.py`).

    python benchmarks/peer.py ENGINE

It reads commands from standard input, one JSON array in a line, and answers each with one JSON value: the CPU seconds
that it took, or a text that says why it cannot.

    ["load", FILE]    make the tree of a file, in place of the one before
    ["parse", FILE]   the same with py_trees' own parser of tree files
    ["tick", COUNT]   tick it so many times; the mean
"""

import functools
import gc
import json
import operator
import re
import sys
import time
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path
from typing import Any

COMPILED = "BehaviorTree.CPP"
COMPILED_WITH_PYTHON = "BehaviorTree.CPP, leaves in Python"
PY_TREES = "py_trees"
Made = tuple[Callable[[], object], Any]
"""What ticks a tree once, and whatever must live as long as it."""


def compiled(path: str, *, leaves_in_python: bool) -> Made:
    """Make a tree of BehaviorTree.CPP; its leaves are AlwaysSuccess in C++, or a function in Python."""
    import behaviortreepy

    factory = behaviortreepy.BehaviorTreeFactory()
    for tag in ("Leaf", "Prepared"):
        factory.register_simple_action(tag, lambda _: behaviortreepy.NodeStatus.SUCCESS)
    text = Path(path).read_text(encoding="utf-8")
    if not leaves_in_python:
        text = re.sub("<(Leaf|Prepared) ", "<AlwaysSuccess ", text)
    tree = factory.create_tree_from_text(text)
    return tree.tick_exactly_once, factory


def built(path: str) -> Made:
    """Build the tree with py_trees' constructors, with its own nodes for ports and scripts."""
    import py_trees

    numbers = iter(range(sys.maxsize))
    success, variable = py_trees.common.Status.SUCCESS, py_trees.behaviours
    all_of = py_trees.common.ParallelPolicy.SuccessOnAll(synchronise=False)

    class Leaf(py_trees.behaviour.Behaviour):
        def update(self) -> Any:
            return success

    class Prepared(Leaf):
        def initialise(self) -> None:
            pass

        def terminate(self, new_status: Any) -> None:
            pass

    class Copy(py_trees.behaviour.Behaviour):
        def __init__(self, name: str, source: str, target: str) -> None:
            super().__init__(name)
            self.board = self.attach_blackboard_client(name)
            self.board.register_key("source", py_trees.common.Access.READ, remap_to=source)
            self.board.register_key("target", py_trees.common.Access.WRITE, remap_to=target)

        def update(self) -> Any:
            self.board.target = self.board.source
            return success

    def build(element: ET.Element) -> Any:
        name = element.get("name") or f"{element.tag} {next(numbers)}"
        children = [build(child) for child in element]
        key, _, value = element.get("code", "").partition(" ")
        makers: dict[str, Callable[[], Any]] = {
            "Sequence": lambda: py_trees.composites.Sequence(name, memory=True, children=children),
            "Parallel": lambda: py_trees.composites.Parallel(name, all_of, children),
            "KeepRunningUntilFailure": lambda: py_trees.decorators.SuccessIsRunning(name, children[0]),
            "Leaf": lambda: Leaf(name),
            "Prepared": lambda: Prepared(name),
            "AlwaysSuccess": lambda: py_trees.behaviours.Success(name),
            "SetBlackboard": lambda: Copy(
                name, "/" + element.get("value", "").strip("{}"), "/" + element.get("output_key", "")
            ),
            "Script": lambda: variable.SetBlackboardVariable(name, key, int(value[3:]), overwrite=True),
            "ScriptCondition": lambda: variable.CheckBlackboardVariableValue(
                name, py_trees.common.ComparisonExpression(key, int(value[3:]), operator.eq)
            ),
        }
        if element.tag not in makers:
            raise LookupError(f"py_trees has no {element.tag}")
        if condition := next((each for each in element.attrib if each.startswith("_")), None):
            raise LookupError(f"py_trees has no {condition}")
        return makers[element.tag]()

    root = build(ET.parse(path).getroot()[0][0])  # noqa: S314 - a file of our own
    return root.tick_once, root


def parsed(path: str) -> Made:
    """Make the tree with py_trees' own parser of tree files."""
    import py_trees
    from py_trees.parsers.behaviour_tree_xml import parse_behaviour_tree_xml
    from py_trees.ports import BehaviourWithPorts, PortInformation

    text = PortInformation(data_type=str)

    def leaf(name: str, inputs: dict[str, Any], outputs: dict[str, Any]) -> type:
        answer = py_trees.common.Status.SUCCESS
        ports = {"INPUT_PORTS": inputs, "OUTPUT_PORTS": outputs, "update": lambda _: answer}
        return type(name, (BehaviourWithPorts,), ports)

    leaves = (leaf("Leaf", {}, {}), leaf("Reader", {"x": text}, {}), leaf("Writer", {}, {"y": text}))
    classes = {each.__name__: each for each in leaves}
    root = parse_behaviour_tree_xml(path, "Main", classes)
    return root.tick_once, root


MAKERS: dict[str, Callable[[str], Made]] = {
    COMPILED: functools.partial(compiled, leaves_in_python=False),
    COMPILED_WITH_PYTHON: functools.partial(compiled, leaves_in_python=True),
    PY_TREES: built,
}


def serve(engine: str) -> None:
    """Answer commands until there are no more."""
    tick, kept = None, None
    for line in sys.stdin:
        command, argument = json.loads(line)
        gc.collect()
        start = time.process_time()
        count = 1
        try:
            if command == "tick":
                assert tick is not None
                count = argument
                for _ in range(count):
                    tick()
            else:
                tick, kept = None, None
                tick, kept = (parsed if command == "parse" else MAKERS[engine])(argument)
            answer: object = (time.process_time() - start) / count
        except Exception as error:  # noqa: BLE001 - whatever another library refuses
            answer = f"{type(error).__name__}: {error}"
        print(json.dumps(answer), flush=True)
    del kept


if __name__ == "__main__":
    serve(sys.argv[1])

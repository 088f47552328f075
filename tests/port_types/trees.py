"""Trees in which a value is passed from one location to another, for each pair of C++ types.

A leaf `W_int` has an output `out` of the type `int`, `R_int` an input `in`, `B_int` a port `both` in both
directions. `W_int` writes 1, `W_string` writes "1", and so on: a value that each numeric type can hold. The
leaves for BehaviorTree.CPP are in C++, and not in this project; `verdicts.txt` has its verdicts on the trees.
"""

from collections.abc import Iterator
from typing import NamedTuple
from xml.sax.saxutils import quoteattr

TYPES = {
    "int": "int",
    "unsigned": "unsigned int",
    "int64": "int64_t",
    "uint64": "uint64_t",
    "int16": "int16_t",
    "uint8": "uint8_t",
    "uint16": "uint16_t",
    "float": "float",
    "double": "double",
    "bool": "bool",
    "string": "std::string",
    "Any": "BT::Any",
    "untyped": "BT::AnyTypeAllowed",
    "ints": "std::vector<int>",
    "doubles": "std::vector<double>",
    "strings": "std::vector<std::string>",
    "Pose": "Pose",
    "Path": "Path",
    "PosePtr": "std::shared_ptr<Pose>",
    "Status": "BT::NodeStatus",
    "Colour": "Colour",
}
"""The types by the names of the leaves. `Pose`, `Path` and `Colour` (an enumeration) are user-defined."""
CONSTANTS = (
    *("3", "1", "-1", "300", "70000", "5000000000", "3.5", "1e3", "007", "+5", "inf"),
    *("true", "x", "1;2;3", 'json:{"a":1}', "SUCCESS"),
)
"""Values as files write them."""
SCRIPTED = ("5", "1", "-1", "300", "70000", "3.5", "true", "'x'", "'7'", "'3.5'", "'1;2'")
"""Values as scripts write them."""
LOOPS = ("LoopInt", "LoopDouble", "LoopBool", "LoopString")
TAKERS = {
    "Sleep": '<Sleep msec="{k}"/>',
    "Delay": '<Delay delay_msec="{k}"><AlwaysSuccess/></Delay>',
    "Timeout": '<Timeout msec="{k}"><AlwaysSuccess/></Timeout>',
    "Repeat": '<Repeat num_cycles="{k}"><AlwaysSuccess/></Repeat>',
    "Retry": '<RetryUntilSuccessful num_attempts="{k}"><AlwaysSuccess/></RetryUntilSuccessful>',
    "RunOnce": '<RunOnce then_skip="{k}"><AlwaysSuccess/></RunOnce>',
    "Parallel": '<Parallel success_count="{k}"><AlwaysSuccess/></Parallel>',
    "ParallelAll": '<ParallelAll max_failures="{k}"><AlwaysSuccess/></ParallelAll>',
    "Switch": '<Switch2 variable="{k}" case_1="1" case_2="2"><AlwaysSuccess/><AlwaysSuccess/><AlwaysSuccess/></Switch2>',
    "case": '<Switch2 variable="1" case_1="{k}" case_2="2"><AlwaysSuccess/><AlwaysSuccess/><AlwaysSuccess/></Switch2>',
    "else": '<Precondition if="true" else="{k}"><AlwaysSuccess/></Precondition>',
    "if_empty": '<LoopInt queue="1" if_empty="{k}" value="{v}"><AlwaysSuccess/></LoopInt>',
    "updated": '<SkipUnlessUpdated entry="{k}"><AlwaysSuccess/></SkipUnlessUpdated>',
    "set": '<SetBlackboard value="{k}" output_key="other"/>',
    "code": '<Script code="{k}"/>',
    "condition": '<ScriptCondition code="{k}"/>',
    "if": '<Precondition if="{k}"><AlwaysSuccess/></Precondition>',
}
"""Nodes of BehaviorTree.CPP that read `k`."""


class Tree(NamedTuple):
    """A tree of a family.

    Attributes:
        family: The kind of tree.
        row: The source of the value.
        column: The destination of the value.
        main: The nodes of the main tree.
        parts: The other trees, by ID.
        model: The models of subtrees.
    """

    family: str
    row: str
    column: str
    main: str
    parts: tuple[tuple[str, str], ...] = ()
    model: str = ""

    def text(self) -> str:
        """Return the text of the file."""
        bodies = "".join(f'<BehaviorTree ID="{name}">{body}</BehaviorTree>\n' for name, body in self.parts)
        used = [name for name in TYPES if f"_{name} " in self.main + bodies]
        return (
            f'<root BTCPP_format="4" main_tree_to_execute="M">\n<BehaviorTree ID="M"><Sequence>{self.main}</Sequence>'
            f"</BehaviorTree>\n{bodies}<TreeNodesModel>{self.model}{''.join(map(_models, used))}</TreeNodesModel></root>"
        )


def _models(name: str) -> str:
    cpp = quoteattr(TYPES[name])
    return (
        f'<Action ID="W_{name}"><output_port name="out" type={cpp}/></Action>'
        f'<Action ID="R_{name}"><input_port name="in" type={cpp}/></Action>'
        f'<Action ID="B_{name}"><inout_port name="both" type={cpp}/></Action>'
    )


def write(name: str, key: str = "k") -> str:
    """Return a leaf that writes a key."""
    return f'<W_{name} out="{{{key}}}"/>'


def read(name: str, key: str = "k") -> str:
    """Return a leaf that reads a key."""
    return f'<R_{name} in="{{{key}}}"/>'


def _idle(body: str) -> str:
    """Return nodes that are created and never ticked."""
    return f"<Fallback><AlwaysSuccess/>{body}</Fallback>"


def trees() -> Iterator[Tree]:
    """Yield all trees."""
    yield from _between_ports()
    yield from _constants()
    yield from _scripts()
    yield from _loops()


def _between_ports() -> Iterator[Tree]:
    for row in TYPES:
        for column in TYPES:
            yield Tree("write then read", row, column, write(row) + read(column))
            yield Tree("port then write", row, column, _idle(read(row)) + write(column))
            yield Tree("untyped first", row, column, _idle(read("untyped")) + write(row) + read(column))
            yield Tree("written twice", row, column, _idle(read("untyped")) + write(row) + write(column))
            copy = '<SetBlackboard value="{j}" output_key="k"/>'
            yield Tree("copy", row, column, write(row, "j") + copy + read(column))
        for column, taker in TAKERS.items():
            yield Tree("write then take", row, column, write(row) + taker)
        remapped = (("A", '<SubTree ID="B" k="{a}"/>'), ("B", read(row)))
        for column in TYPES:
            main = write(column) + '<SubTree ID="A" a="{k}"/>'
            yield Tree("through two subtrees", column, row, main, remapped)
        both = f'<B_{row} both="{{k}}"/>'
        for column in TYPES:
            yield Tree("write then change", column, row, write(column) + both)


def _constants() -> Iterator[Tree]:
    for row in CONSTANTS:
        value = quoteattr(row)
        for column in TYPES:
            part = (("P", read(column)),)
            yield Tree("literal", row, column, f"<R_{column} in={value}/>")
            yield Tree("constant", row, column, f'<SubTree ID="P" k={value}/>', part)
            model = f'<SubTree ID="P"><input_port name="k" default={value}/></SubTree>'
            yield Tree("default of a model", row, column, '<SubTree ID="P"/>', part, model)
            inner = (("A", '<SubTree ID="P" k="{a}"/>'), *part)
            yield Tree("constant through two subtrees", row, column, f'<SubTree ID="A" a={value}/>', inner)
            yield Tree(
                "constant overwritten", row, column, f'<SubTree ID="P" k={value}/>', (("P", write(column)),)
            )
            yield Tree("set", row, column, f'<SetBlackboard value={value} output_key="k"/>{read(column)}')
        for column, taker in TAKERS.items():
            yield Tree("constant taken", row, column, f'<SubTree ID="P" k={value}/>', (("P", taker),))
            yield Tree("set taken", row, column, f'<SetBlackboard value={value} output_key="k"/>{taker}')
        for column in LOOPS:
            loop = f'<{column} queue="{{k}}" value="{{v}}"><AlwaysSuccess/></{column}>'
            yield Tree("constant looped over", row, column, f'<SubTree ID="P" k={value}/>', (("P", loop),))
            yield Tree("set looped over", row, column, f'<SetBlackboard value={value} output_key="k"/>{loop}')


def _scripts() -> Iterator[Tree]:
    for row in SCRIPTED:
        script = f"<Script code={quoteattr(f'k := {row}')}/>"
        for column in TYPES:
            yield Tree("script", row, column, script + read(column))
            inner = (("A", '<SubTree ID="P" k="{a}"/>'), ("P", read(column)))
            yield Tree("script into a subtree", row, column, script + '<SubTree ID="A" a="{k}"/>', inner)
            copied = f"<Script code={quoteattr(f'j := {row}')}/>"
            copy = '<SetBlackboard value="{j}" output_key="k"/>'
            yield Tree("script copied", row, column, copied + copy + read(column))
            yield Tree("written then scripted", column, row, write(column) + script)
        for column, taker in TAKERS.items():
            yield Tree("script taken", row, column, script + taker)
        for column in LOOPS:
            loop = f'<{column} queue="{{k}}" value="{{v}}"><AlwaysSuccess/></{column}>'
            yield Tree("script looped over", row, column, script + loop)
    for row in TYPES:
        for column in TYPES:
            copy = '<Script code="k := j"/>'
            yield Tree("copied by a script", row, column, write(row, "j") + copy + read(column))


def _loops() -> Iterator[Tree]:
    for row in TYPES:
        for column in LOOPS:
            loop = f'<{column} queue="{{k}}" value="{{v}}"><AlwaysSuccess/></{column}>'
            yield Tree("looped over", row, column, write(row) + loop)
    for row in LOOPS:
        items = {"LoopBool": "true;false", "LoopDouble": "1.5;2"}.get(row, "1;2")
        for column in TYPES:
            yield Tree("item", row, column, f'<{row} queue="{items}" value="{{k}}">{read(column)}</{row}>')
            early = _idle(read(column))
            yield Tree(
                "port then item",
                column,
                row,
                f'{early}<{row} queue="{items}" value="{{k}}"><AlwaysSuccess/></{row}>',
            )
        for column, taker in TAKERS.items():
            yield Tree("item taken", row, column, f'<{row} queue="{items}" value="{{k}}">{taker}</{row}>')

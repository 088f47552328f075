"""Tests of values that do not fit their readers: strings for numbers, numbers out of range, ports that no node reads."""

import pytest

from sar_compiler.checks import check
from sar_compiler.nodes.registry import default_registry
from tests.trees import forest_of

TREE = """<root BTCPP_format="4" main_tree_to_execute="Main">
<BehaviorTree ID="Main"><Sequence>
{body}
<Drive {port}="{{value}}"/>
</Sequence></BehaviorTree>
<BehaviorTree ID="Part"><Drive {port}="{{given}}"/></BehaviorTree>
<TreeNodesModel>
<Action ID="Drive"><input_port name="speed" type="double"/><input_port name="count" type="int"/>
<input_port name="on" type="bool"/><input_port name="word" type="std::string"/><input_port name="any"/>
<output_port name="told" type="double"/></Action>
</TreeNodesModel></root>"""


def findings_in(body, port="speed"):
    findings = check(forest_of(TREE.format(body=body, port=port)), default_registry())
    return [(each.code, each.span.line, each.span.column) for each in findings if each.code != "unused-tree"]


@pytest.mark.parametrize("port", ["speed", "count", "on", "told"])
@pytest.mark.parametrize(
    ("body", "column"),
    [
        ("<Script code=\"value := 'fast'\"/>", 24),
        ("<Script code=\"x := 1; value := 'fast'\"/>", 32),
        ("<Script code=\"value := 1; value = 'fast'\"/>", 35),
        ("<AlwaysSuccess _onSuccess=\"value := 'fast'\"/>", 37),
    ],
)
def test_string_for_number_is_found_at_assignment(body, column, port):
    told = findings_in(body, port)
    assert ("key-of-two-types", 3, column) in told
    assert {code for code, *_ in told} <= {"key-of-two-types", "overwritten-key", "unread-key"}


def test_string_for_number_is_found_at_argument_of_subtree():
    assert findings_in('<Script code="value := 1"/><SubTree ID="Part" given="fast"/>') == [
        ("key-of-two-types", 3, 54)
    ]
    # A string that is the name of a key lacks its braces.
    named = '<Script code="value := 1"/><SubTree ID="Part" given="value"/>'
    assert findings_in(named) == [("key-as-text", 3, 54)]
    script = "<Script code=\"value := 1; other := 'fast'\"/>"
    assert findings_in(f'{script}<SubTree ID="Part" given="{{other}}"/>') == [("key-of-two-types", 3, 36)]


@pytest.mark.parametrize(
    ("written", "port"),
    [
        ("'1.5'", "speed"),
        ("'7'", "count"),
        ("'true'", "on"),
        ("7", "count"),
        ("1.5", "speed"),
        ("'fast'", "word"),
        ("'fast'", "any"),
        ("x ? 'a' : 'b'", "speed"),
    ],
)
def test_readable_or_unknown_value_is_no_finding(written, port):
    body = f'<Script code="x := 1; value := {written}"/><ScriptCondition code="x == 1"/><SubTree ID="Part" given="{{x}}"/>'
    assert findings_in(body, port) == []


@pytest.mark.parametrize(
    ("cpp", "fits", "too_large"),
    [
        ("short", ["32767", "-32768"], ["32768", "-32769"]),
        ("int", ["2147483647", "-2147483648"], ["2147483648", "3000000000", "-2147483649"]),
        ("unsigned int", ["0", "4294967295"], ["-1", "4294967296"]),
        ("int64_t", ["9223372036854775807", "-9223372036854775808"], ["9223372036854775808"]),
        ("uint64_t", ["18446744073709551615"], ["-1", "18446744073709551616"]),
        ("std::vector&lt;int&gt;", ["1;2147483647"], ["1;2147483648"]),
    ],
)
def test_number_out_of_range_of_cpp_type_is_wrong_value(cpp, fits, too_large):
    for number in (*fits, *too_large):
        text = (
            f'<root BTCPP_format="4"><BehaviorTree ID="Main">\n<Drive count="{number}"/></BehaviorTree>\n'
            f'<TreeNodesModel><Action ID="Drive"><input_port name="count" type="{cpp}"/></Action></TreeNodesModel></root>'
        )
        codes = [(each.code, each.span.line) for each in check(forest_of(text), default_registry())]
        assert codes == [("wrong-value", 2)] * (number in too_large), number


SUBTREE = """<root BTCPP_format="4" main_tree_to_execute="Main">
<BehaviorTree ID="Main"><Sequence><Script code="pause := 5"/>{use}</Sequence></BehaviorTree>
<BehaviorTree ID="Part"><Sleep msec="{{time}}"/></BehaviorTree>
<TreeNodesModel><SubTree ID="Part">
<input_port name="{port}"/><input_port name="time"/></SubTree></TreeNodesModel></root>"""


@pytest.mark.parametrize("given", ["7", "{pause}"])
def test_port_of_subtree_model_missing_from_tree_is_found_in_model(given):
    use = f'<SubTree ID="Part" time="{{pause}}" goal="{given}"/>'
    findings = check(forest_of(SUBTREE.format(use=use, port="goal")), default_registry())
    assert [(each.code, each.span.line, each.span.column) for each in findings] == [("model-mismatch", 5, 19)]


def test_misspelt_port_of_subtree_model_gets_suggestion():
    text = SUBTREE.format(use='<SubTree ID="Part" tiem="{pause}"/>', port="tiem")
    findings = check(forest_of(text.replace('<input_port name="time"/>', "")), default_registry())
    assert ("model-mismatch", "time") in [(each.code, each.suggestion) for each in findings]


def test_string_is_found_after_long_chain_of_copies():
    chain = [
        f'<SetBlackboard value="{{k{number}}}" output_key="k{number + 1}"/>' * copies
        for copies in (1, 2)
        for number in range(20 * (copies - 1), 20 * copies)
    ]
    # In the second half, each key is copied twice from the previous key; both copies have the same value.
    body = "\n".join(["<Script code=\"k0 := 'fast'\"/>", *chain])
    last = f'<SetBlackboard value="{{k{len(chain)}}}" output_key="value"/>'
    assert ("key-of-two-types", 4 + len(chain), 23) in findings_in(f"{body}\n{last}")


@pytest.mark.parametrize(
    ("written", "suggestion"), [("+5", "5"), ("-5", None), ("5", None), ("1e3", None), ("+.5", ".5")]
)
def test_plus_sign_before_number_is_reported(written, suggestion):
    text = TREE.format(body="<AlwaysSuccess/>", port="word").replace('word="{value}"', f'speed="{written}"')
    findings = [
        each for each in check(forest_of(text), default_registry()) if each.code == "cpp-type-mismatch"
    ]
    assert [(each.suggestion, each.span.line) for each in findings] == (
        [(suggestion, 4)] if suggestion else []
    )


@pytest.mark.parametrize(("children", "codes"), [(1, ["out-of-reach"]), (2, ["out-of-reach"]), (3, [])])
def test_count_written_by_script_is_compared_with_number_of_children(children, codes):
    parallel = f'<Parallel success_count="{{n}}">{"<AlwaysSuccess/>" * children}</Parallel>'
    enough = '<Parallel success_count="{n}"><AlwaysSuccess/><AlwaysSuccess/><AlwaysSuccess/></Parallel>'
    text = f'<root BTCPP_format="4"><BehaviorTree ID="M"><Sequence><Script code="n := 3"/>{enough}{parallel}</Sequence></BehaviorTree></root>'
    found = [each.code for each in check(forest_of(text), default_registry())]
    assert [code for code in found if code != "needless-node"] == codes


@pytest.mark.parametrize("items", ["1;x", "x", "1;2.5"])
def test_loop_items_are_compared_with_ports_that_read_them(items):
    loop = f'<LoopString queue="{items}" value="{{k}}"><Drive count="{{k}}"/></LoopString>'
    text = TREE.format(body=loop, port="any").replace('<Drive any="{value}"/>', "")
    codes = [each.code for each in check(forest_of(text), default_registry())]
    assert codes.count("key-of-two-types") == 1


BOTH = """<root BTCPP_format="4"><BehaviorTree ID="Main"><Count {written}/></BehaviorTree>
<TreeNodesModel><Action ID="Count"><inout_port name="times" type="{cpp}"/>{note}</Action></TreeNodesModel></root>"""
FROM_USE = '<MetadataFields><Metadata made="from use"/></MetadataFields>'


@pytest.mark.parametrize(
    ("cpp", "written", "note", "told"),
    [
        ("int", 'times="3"', "", ["warning"]),
        ("std::string", 'times="x"', "", ["warning"]),
        ("", 'times=""', "", ["warning"]),
        ("int", 'times="x"', "", ["error"]),
        ("int", 'times="{times}"', "", []),
        ("int", 'times="{=}"', "", []),
        ("int", "", "", []),
        ("int", 'times="3"', FROM_USE, []),
    ],
)
def test_valid_literal_for_inout_port_is_warning(cpp, written, note, told):
    # BehaviorTree.CPP raises when the node writes the port: setOutput requires a blackboard pointer.
    found = check(forest_of(BOTH.format(cpp=cpp, written=written, note=note)), default_registry())
    assert [each.severity.value for each in found if each.code == "wrong-value"] == told


def test_literal_queue_of_loop_is_no_wrong_value():
    body = '<LoopInt queue="1;2" value="{v}"><Drive count="{v}"/></LoopInt>'
    assert "wrong-value" not in {code for code, *_ in findings_in(body)}


def test_string_copied_over_number_of_subtree_is_one_finding():
    part = '<BehaviorTree ID="P"><Sequence><SetBlackboard value="{text}" output_key="k"/></Sequence></BehaviorTree>'
    for text, told in (("x", ["cpp-type-mismatch"]), ("7", []), ("-7", [])):
        tree = TREE.format(body='<SubTree ID="P" k="3"/>', port="speed").replace(
            "<TreeNodesModel>", f"{part.format(text=text)}<TreeNodesModel>"
        )
        found = check(forest_of(tree), default_registry())
        assert [each.code for each in found if "type" in each.code] == told, text


def test_port_that_writes_first_only_in_some_runs_is_no_finding():
    # A number cannot overwrite a string, but a string can overwrite a number.
    body = '<Fallback><AlwaysFailure/><Drive any="{k}"/></Fallback>'
    writes = ('<W_string out="{k}"/>', '<W_int out="{k}"/>')
    models = "".join(
        f'<Action ID="W_{name}"><output_port name="out" type="{cpp}"/></Action>'
        for name, cpp in (("string", "std::string"), ("int", "int"))
    )
    for written, told in (
        (f"<Sequence>{''.join(writes)}</Sequence>", ["cpp-type-mismatch"]),
        (f"<Sequence>{''.join(reversed(writes))}</Sequence>", []),
        (f"<Fallback>{''.join(writes)}</Fallback>", []),
    ):
        tree = TREE.format(body=body + written, port="speed").replace(
            "</TreeNodesModel>", f"{models}</TreeNodesModel>"
        )
        found = check(forest_of(tree), default_registry())
        assert [each.code for each in found if each.code == "cpp-type-mismatch"] == told, written

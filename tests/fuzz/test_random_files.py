"""Tests that reading and checking a file with any bytes ends with findings."""

import random
import re
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sar_compiler.checks import check
from sar_compiler.compiler import bind_main, preview_tree
from sar_compiler.nodes.registry import default_registry
from sar_compiler.tree.diagnostic import TreeError
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.xml import parse_xml
from sar_compiler.tree.yaml import parse_yaml
from tests.fuzz.bounds import TooMuchWorkError, at_most
from tests.random_inputs import rounds

PARSERS = {".xml": parse_xml, ".yaml": parse_yaml}
SHIPPED = [path for path in sorted(Path("trees").iterdir()) if path.suffix in PARSERS]
DENSE = (
    b'<root main_tree_to_execute="A"><include path="x"/><BehaviorTree ID="A"><Parallel success_count="1">'
    b'<SubTree ID="B" x="{y}" z="7" _skipIf="a &amp;&amp; b"/><Script code="a := 1; b := \'t\'"/>'
    b'<Retry num_failures="3"><Action ID="Fly" height="2"/></Retry></Parallel></BehaviorTree>'
    b'<BehaviorTree ID="B"><Timeout msec="5"><Sleep msec="{x}"/></Timeout></BehaviorTree>'
    b'<TreeNodesModel><Action ID="Fly"><input_port name="height" type="double"/></Action></TreeNodesModel></root>'
)
SEEDS = [(path.suffix, path.read_bytes()) for path in SHIPPED] + [
    (".xml", DENSE),
]
WORDS = [
    b"<", b">", b"/", b'"', b"'", b"&", b"=", b"{", b"}", b"\0", b"\xff", b"\xef\xbb\xbf", b"\r", b"\t", b"  ", b":",
    b"- ", b"<!--", b"<![CDATA[", b"<!DOCTYPE a>", b"<?x?>", b"&#0;", b"&lt;", b"*a", b"&a", b"<<: ", b"!!python ",
    b"BehaviorTree", b"SubTree", b"Sequence", b"memory", b"children:", b"_skipIf", b"9" * 400, b"[" * 300, b"<a>" * 300,
]  # fmt: skip
VALUE = re.compile(rb"""(="|: )([^"\n]+)("|\n)""")
CALLS = 3_000_000
"""More calls than any of these files needs."""


def mutate(choice, data):
    """Return a changed file. Half of the changes affect only values of attributes."""
    return _other_values(choice, data) if choice.random() < 0.5 else _other_bytes(choice, data)


def _other_values(choice, data):
    def other(match):
        said = choice.choice(
            [b"", b"{x}", b"7", b"true", b"A", b"B", b"-1", b"a := 1", b"a b/c", match[2][::-1]]
        )
        return match[1] + said + match[3] if choice.random() < 0.1 else match[0]

    return VALUE.sub(other, data)


def _other_bytes(choice, data):
    data = bytearray(data)
    for _ in range(choice.randint(1, 8)):
        at, length = choice.randrange(len(data) + 1), choice.randint(1, 30)
        kind = choice.randrange(4)
        if kind == 0:
            del data[at : at + length]
        elif kind == 1:
            data[at:at] = data[at : at + length]
        elif kind == 2:
            data[at:at] = choice.choice(WORDS)
        else:
            data[at : at + 1] = bytes([choice.randrange(256)])
    return bytes(data)


def answer(suffix, data):
    """Read, check and preview a file; return the codes of its findings."""
    try:
        with at_most(CALLS):
            forest = Forest.from_file(PARSERS[suffix](data, f"random{suffix}"))
            findings = check(forest, default_registry())
            if not findings:
                preview_tree(bind_main(forest, default_registry()))
    except TreeError as error:
        findings = list(error.findings)
        assert findings
    for finding in findings:
        assert finding.render()
        assert finding.code != "internal-error", finding.message
    return [finding.code for finding in findings]


def answers(seed, count):
    choice = random.Random(seed)  # noqa: S311 - a test that is the same every time
    for _ in range(count):
        suffix, data = choice.choice(SEEDS)
        data = mutate(choice, data)
        try:
            yield answer(suffix, data)
        except Exception as error:
            error.args = (f"{error} for the {suffix} file {data!r}",)
            raise


@settings(max_examples=rounds(250))
@given(st.sampled_from(sorted(PARSERS)), st.binary(max_size=200))
def test_random_bytes_produce_findings(suffix, data):
    assert answer(suffix, data)


def test_mutated_files_produce_findings_or_trees():
    codes = list(answers(1, rounds(400)))
    assert [] in codes, "no mutation left a file whole, so compiling was not tried"
    assert len({code for each in codes for code in each}) > 15


@pytest.mark.slow
def test_hundred_thousand_mutated_files_produce_findings_or_trees():
    assert sum(1 for _ in answers(2, 100_000)) == 100_000


def test_work_above_bound_is_detected():
    with pytest.raises(TooMuchWorkError), at_most(100):
        loop_forever()


def loop_forever():
    while True:
        do_nothing()


def do_nothing():
    return None

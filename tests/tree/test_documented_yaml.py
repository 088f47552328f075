"""Tests of the examples on docs/reference/yaml.md."""

import re
from pathlib import Path

from sar_compiler.tree.yaml import parse_yaml
from sar_compiler.tree.yaml_writer import write_yaml

PAGE = Path("docs/reference/yaml.md").read_text(encoding="utf-8")


def test_example_is_in_canonical_form():
    example = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)[0]
    assert write_yaml(parse_yaml(example)) == example


def test_documented_strings_are_read_as_strings():
    texts = re.findall(r"^\| `(name: [^`]+)` \|[^|]*\| the string `([^`]+)` \|$", PAGE, re.MULTILINE)
    assert len(texts) == 3
    for written, text in texts:
        assert parse_yaml(f"root: {{{written}}}").root.attributes == {"name": text}


def test_documented_written_forms_are_valid():
    for written in re.findall(r"\| `(\w+: '[^`]+')`", PAGE):
        assert len(parse_yaml(f"root:\n  {written}\n").root.attributes) == 1

"""Reading YAML files so that every complaint names file, line and key."""

import difflib
import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import yaml

from sar_compiler.errors import SarError

# Files of this kind are small; what is larger was not meant.
_MAX_BYTES = 1_000_000


class YamlFileError(SarError):
    """A YAML file does not say what it has to say.

    Attributes:
        path: The file.
        line: Line of the fault, from 1, or None where it is the whole file.
        key: The key at fault, dotted from the top, or "".
        problem: What is wrong there.
    """

    def __init__(self, path: Path, line: int | None, key: str, problem: str) -> None:
        self.path, self.line, self.key, self.problem = path, line, key, problem
        place = str(path) if line is None else f"{path}:{line}"
        super().__init__(f"{place}: {key}: {problem}" if key else f"{place}: {problem}")


@dataclass(frozen=True)
class YamlValue:
    """One node of a YAML file, and where it stands.

    Attributes:
        path: The file.
        key: Its key, dotted from the top; "" at the top.
        node: What PyYAML composed.
    """

    path: Path
    key: str
    node: yaml.Node

    def fail(self, problem: str) -> NoReturn:
        """Say that *problem* is here.

        Raises:
            YamlFileError: Always.
        """
        raise YamlFileError(self.path, self.node.start_mark.line + 1, self.key, problem)

    def mapping(
        self, required: Collection[str] = (), optional: Collection[str] | None = ()
    ) -> Mapping[str, "YamlValue"]:
        """Return the keys and values of this node.

        Args:
            required: Keys that have to be there.
            optional: Further keys that may be there; None allows any.

        Raises:
            YamlFileError: If it is not a mapping, or a key is missing, unknown or given twice.
        """
        if not isinstance(self.node, yaml.MappingNode):
            self.fail(f"expected a mapping{_listed(required)}, found {self._kind()}")
        found: dict[str, YamlValue] = {}
        for key_node, value_node in self.node.value:
            name = str(key_node.value) if isinstance(key_node, yaml.ScalarNode) else "?"
            value = YamlValue(self.path, f"{self.key}.{name}" if self.key else name, value_node)
            if name in found:
                YamlValue(self.path, value.key, key_node).fail("is given twice")
            if optional is not None and name not in required and name not in optional:
                YamlValue(self.path, value.key, key_node).fail(_unknown(name, [*required, *optional]))
            found[name] = value
        missing = [name for name in required if name not in found]
        if missing:
            self.fail(f"'{missing[0]}' is missing{_listed(required)}")
        return found

    def items(self) -> Iterator["YamlValue"]:
        """Yield the items of a list.

        Raises:
            YamlFileError: If it is not a list.
        """
        if not isinstance(self.node, yaml.SequenceNode):
            self.fail(f"expected a list, found {self._kind()}")
        for index, item in enumerate(self.node.value):
            yield YamlValue(self.path, f"{self.key}[{index}]", item)

    def number(self, *, above: float | None = None) -> float:
        """Return a finite number.

        Args:
            above: The number has to be greater than this.

        Raises:
            YamlFileError: If it is anything else.
        """
        expected = "a number" if above is None else f"a number greater than {above:g}"
        try:
            value = float(self.node.value) if isinstance(self.node, yaml.ScalarNode) else math.nan
        except ValueError:
            value = math.nan
        if not math.isfinite(value) or (above is not None and value <= above):
            self.fail(f"expected {expected}, found {self._kind()}")
        return value

    def text(self, allowed: Collection[str] = ()) -> str:
        """Return a piece of text.

        Args:
            allowed: The texts that may stand here; empty allows any.

        Raises:
            YamlFileError: If it is no text, or none of *allowed*.
        """
        if not isinstance(self.node, yaml.ScalarNode) or not self.node.value:
            self.fail(f"expected text{_listed(allowed)}, found {self._kind()}")
        value = str(self.node.value)
        if allowed and value not in allowed:
            self.fail(_unknown(value, list(allowed)))
        return value

    def _kind(self) -> str:
        if isinstance(self.node, yaml.MappingNode):
            return "a mapping"
        if isinstance(self.node, yaml.SequenceNode):
            return "a list"
        return f"'{self.node.value}'" if self.node.value else "nothing"


def read_yaml(path: Path, error: type[SarError]) -> YamlValue:
    """Read a YAML file without interpreting it.

    Args:
        path: The file.
        error: What to raise where the file cannot be read at all.

    Raises:
        SarError: *error*, if there is no such file or it is not text.
        YamlFileError: If it is not YAML, or empty.
    """
    try:
        content = path.read_bytes()[: _MAX_BYTES + 1]
    except OSError as exception:
        message = f"{path}: cannot be read ({exception.strerror or exception})"
        raise error(message) from exception
    if len(content) > _MAX_BYTES:
        raise YamlFileError(path, None, "", f"is larger than {_MAX_BYTES} bytes")
    try:
        node = yaml.compose(content, Loader=yaml.SafeLoader)
    except yaml.MarkedYAMLError as exception:
        line = exception.problem_mark.line + 1 if exception.problem_mark else None
        raise YamlFileError(path, line, "", f"is not YAML ({exception.problem})") from exception
    except (yaml.YAMLError, UnicodeDecodeError) as exception:
        raise YamlFileError(path, None, "", "is not YAML text") from exception
    if node is None:
        raise YamlFileError(path, None, "", "is empty")
    return YamlValue(path, "", node)


def _listed(names: Collection[str]) -> str:
    return f" (expected: {', '.join(names)})" if names else ""


def _unknown(name: str, allowed: list[str]) -> str:
    near = difflib.get_close_matches(name, allowed, n=1)
    return f"'{name}' is not known here{_listed(allowed)}" + (f"; did you mean '{near[0]}'?" if near else "")

"""The records of this project's nodes as data, so that trees of them are checked without an import of their classes.

`records.jsonl` beside the `__init__` of a package that registers nodes has what its classes say: in its first line what
the registry looks nodes up by, then a line for each. `make schemas` renews it. It counts only if it was made from the
very files that are installed: the checksum of each file that it depends on is compared. If one differs, the package is
imported, as anybody's is.
"""

import functools
import importlib
import json
import sys
import zlib
from collections.abc import Sequence
from importlib.machinery import PathFinder
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from sar_compiler.nodes.imports import Deferred, load
from sar_compiler.nodes.spec import MARK, NodeSpec, Parameter, Provenance, Signature
from sar_compiler.nodes.values import PLAIN, ValueType

FILE = "records.jsonl"
_OWN = __name__.partition(".")[0]


class Record(NamedTuple):
    """A node of a records file, of which only what the registry looks it up by is read yet.

    Attributes:
        tag: The tag in a tree file.
        maker_path: The import path of what makes its instances.
        variant: Whether it is a further meaning of an existing tag.
        former_tags: Its names in earlier versions of BehaviorTree.CPP and py_trees.
        module: The import path of the package that registers it.
        line: Its line of the file.
    """

    tag: str
    maker_path: str
    variant: bool
    former_tags: Sequence[str]
    module: str
    line: bytes

    def spec(self) -> NodeSpec:
        """Return all that is known of the node."""
        fields = {name: decoded(value) for name, value in json.loads(self.line).items()}
        empty: dict[str, object] = {"facts": {}, "former_attributes": {}}
        own = {"tag": self.tag, "maker_path": self.maker_path, "variant": self.variant}
        more = {"former_tags": tuple(self.former_tags), "registered_by": self.module}
        restored: NodeSpec = _restored(RecordedSpec, {**empty, **more, **own, **fields})
        return restored


class RecordedSpec(NodeSpec):
    """A record whose class is imported when it is first asked for: to make a node, not to check one.

    Attributes:
        registered_by: The import path of the package that registers the node.
    """

    is_only_described = is_foreign = False
    provenance = Provenance.INSTALLED
    absent_methods = ()
    registered_by: str

    @functools.cached_property
    def _original(self) -> NodeSpec:
        specs = specs_of(importlib.import_module(self.registered_by))
        return next(each for each in specs if each.tag == self.tag and each.maker_path == self.maker_path)

    @functools.cached_property
    def cls(self) -> type[Any] | None:
        """The class that the compiler instantiates."""
        return self._original.cls

    @functools.cached_property
    def signature(self) -> Signature:
        """Declarations about its attributes in addition to the constructor."""
        return self._original.signature


class RecordedParameter(Parameter):
    """A parameter whose class is imported when it is first asked for."""

    @functools.cached_property
    def target(self) -> type | None:
        """The class of the node or of the object that it takes."""
        found: type | None = load(self.target_path) if self.target_path else None
        return found


class RecordedType(ValueType):
    """A type of values whose class is imported when it is first asked for.

    Attributes:
        python_path: The import path of the class.
    """

    python_path: str

    @functools.cached_property
    def python(self) -> type | None:
        """The type of its values."""
        found: type = load(self.python_path)
        return found


def recorded(module: str) -> list[Record] | None:
    """Return the records of the nodes that a package registers; None if there are none, or none that count any more."""
    if module.partition(".")[0] != _OWN:
        return None
    try:
        first, *lines = _folder(_OWN).joinpath(*module.split(".")[1:], FILE).read_bytes().splitlines()
    except FileNotFoundError:
        return None
    known = json.loads(first)
    if any(checksum(file) != expected for file, expected in known["sources"].items()):
        return None
    return [Record._make([*found, module, line]) for found, line in zip(known["nodes"], lines, strict=True)]


def specs_of(module: ModuleType) -> list[NodeSpec]:
    """Return the records of the nodes that an imported module registers, or lists."""
    marked = [
        vars(each)[MARK] for each in vars(module).values() if isinstance(each, type) and MARK in vars(each)
    ]
    return [*marked, *getattr(module, "SPECS", ())]


def checksum(file: str) -> int | None:
    """Return the checksum of a file of a package, as `py_trees/composites.py`; None if there is none."""
    try:
        return zlib.crc32((_folder(file.partition("/")[0]).parent / file).read_bytes())
    except OSError:
        return None


@functools.cache
def _folder(package: str) -> Path:
    """Return the folder of a package, which is not imported for that."""
    module = sys.modules.get(package)
    spec = module.__spec__ if module is not None else PathFinder.find_spec(package)
    return Path(*((spec and spec.submodule_search_locations) or [package])[:1])


def decoded(value: Any) -> Any:
    """Return the value of a part of the data: a list is a tuple, the first key of a mapping names another kind."""
    if isinstance(value, list):
        return tuple(map(decoded, value))
    if not isinstance(value, dict):
        return value
    kind, said = next(iter(value.items()))
    return _DECODERS[kind](said, {name: decoded(each) for name, each in list(value.items())[1:]})


def _restored(cls: type, fields: dict[str, Any]) -> Any:
    """Return an object of a frozen class without its constructor."""
    made: Any = object.__new__(cls)
    vars(made).update(fields)
    return made


_load = functools.cache(load)


@functools.cache
def _imported(path: str) -> Any:
    """Return a class or function if its module is imported already, else the way to it; for a path always the same."""
    return load(path) if path.partition(":")[0] in sys.modules else Deferred(path)


def _object(path: str, fields: dict[str, Any]) -> Any:
    return _load(path)(**fields)


_DECODERS = {
    "$map": lambda _, fields: fields,
    "$set": lambda items, _: frozenset(map(decoded, items)),
    "$list": lambda items, _: list(map(decoded, items)),
    "$import": lambda path, _: _imported(path),
    "$member": lambda path, _: _load(path),
    "$partial": lambda path, fields: functools.partial(
        _imported(path), *fields["args"], **fields["keywords"]
    ),
    "$type": lambda path, _: _load(path) if ":" in path else PLAIN[path],
    "$enumeration": lambda path, fields: _restored(RecordedType, {"python_path": path, **fields}),
    "$parameter": lambda path, fields: _restored(RecordedParameter, {"target_path": path, **fields}),
    "$": _object,
}

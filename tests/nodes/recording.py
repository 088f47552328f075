"""Writes the data that `nodes.records` reads: all that is known of the nodes of a package."""

import functools
import importlib
import json
import sys
from collections.abc import Mapping
from dataclasses import MISSING, Field, fields
from enum import Enum
from types import FunctionType
from typing import Any

from sar_compiler.nodes import constructors, values
from sar_compiler.nodes.imports import path_of
from sar_compiler.nodes.records import checksum, specs_of
from sar_compiler.nodes.spec import NodeSpec, Parameter
from sar_compiler.nodes.values import PLAIN, ValueType


def records_text(module: str) -> str:
    """Return the content of the records file of a package that registers nodes.

    Raises:
        TypeError: If a record holds what cannot be written as data, such as a function within another.
    """
    recording = _Recording()
    specs = specs_of(importlib.import_module(module))
    specs.sort(key=lambda spec: (spec.tag, spec.variant))
    lines = [recording.node(spec) for spec in specs]
    nodes = [[spec.tag, spec.maker_path, spec.variant, spec.former_tags] for spec in specs]
    sources = {file: checksum(file) for file in sorted(map(_file_of, {module, *recording.modules}))}
    texts = (json.dumps(each, ensure_ascii=False) for each in [{"sources": sources, "nodes": nodes}, *lines])
    return "\n".join([*texts, ""])


def recording_of(spec: NodeSpec) -> dict[str, Any]:
    """Return all that is known of a node, as data."""
    return _Recording().node(spec)


class _Recording:
    def __init__(self) -> None:
        self.modules = {constructors.__name__, values.__name__}

    def node(self, spec: NodeSpec) -> dict[str, Any]:
        self.path(spec.maker)
        for each in spec.cls.__mro__ if spec.cls is not None else ():
            self.path(each)
        names = [
            "doc",
            "fixed",
            "parameters",
            "ancestry",
            *(["absent_methods"] if spec.absent_methods else []),
        ]
        read = {name: self.encoded(getattr(spec, name)) for name in names}
        return {**self._fields(spec, "tag", "cls", "variant", "former_tags", "signature"), **read}

    def path(self, thing: Any) -> str:
        """Return an import path, and note the module."""
        path = path_of(thing)
        if "<" in path:
            message = f"{path} cannot be imported by its name"
            raise TypeError(message)
        if thing.__module__.partition(".")[0] not in sys.stdlib_module_names:
            self.modules.add(thing.__module__)
        return path

    def encoded(self, value: Any) -> Any:
        """Return a value as data; see `records.decoded`."""
        if isinstance(value, Enum):
            return {"$member": f"{self.path(type(value))}.{value.name}"}
        if value is None or isinstance(value, (bool, int, float, str)):
            return value
        if isinstance(value, Mapping):
            return {"$map": "", **{name: self.encoded(each) for name, each in value.items()}}
        if type(value) is tuple:
            return [self.encoded(each) for each in value]
        if isinstance(value, (list, frozenset)):
            name = "$list" if isinstance(value, list) else "$set"
            return {name: [self.encoded(each) for each in (value if name == "$list" else sorted(value))]}
        return self._object(value)

    def _object(self, value: Any) -> dict[str, Any]:
        if isinstance(value, (type, FunctionType)):
            return {"$import": self.path(value)}
        if isinstance(value, functools.partial):
            arguments = {"args": self.encoded(value.args), "keywords": self.encoded(value.keywords)}
            return {"$partial": self.path(value.func), **arguments}
        if isinstance(value, ValueType):
            return self._type(value)
        if isinstance(value, Parameter):
            target = self.path(value.target) if value.target is not None else ""
            return {"$parameter": target, **self._fields(value, "target")}
        return {"$": self.path(type(value)), **self._fields(value)}

    def _fields(self, value: Any, *left_out: str) -> dict[str, Any]:
        """Return what the fields of an object hold, other than their defaults."""
        if hasattr(value, "_asdict"):
            given = {
                name: each
                for name, each in value._asdict().items()
                if each != value._field_defaults.get(name)
            }
            return {name: self.encoded(each) for name, each in given.items()}
        return {
            each.name: self.encoded(getattr(value, each.name))
            for each in fields(value)
            if each.name not in left_out and getattr(value, each.name) != _default(each)
        }

    def _type(self, value: ValueType) -> dict[str, Any]:
        name = _name_of(value)
        if name is not None:
            return {"$type": name}
        if isinstance(value.python, type) and issubclass(value.python, Enum):
            return {"$enumeration": self.path(value.python), **self._fields(value, "python")}
        return {"$": self.path(ValueType), **self._fields(value)}


def _file_of(module: str) -> str:
    """Return the file of an imported module, seen from the folder of its package."""
    imported = sys.modules[module]
    parts = module.split(".")
    last = "__init__.py" if hasattr(imported, "__path__") else f"{parts.pop()}.py"
    return "/".join([*parts, last])


def _default(field: "Field[Any]") -> object:
    return field.default_factory() if field.default_factory is not MISSING else field.default


def _name_of(value: ValueType) -> str | None:
    """Return the name of one of the types that exist only once."""
    if PLAIN.get(value.name) is value:
        return value.name
    return next((f"{values.__name__}:{name}" for name, each in vars(values).items() if each is value), None)

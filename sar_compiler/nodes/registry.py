"""The registry of tags. Schemas, checks and the compiler are derived from it."""

import functools
import importlib
import os
import re
from collections.abc import Callable, Collection, Iterable, Iterator, KeysView, Sequence
from pathlib import Path
from types import ModuleType

from sar_compiler.errors import SarError
from sar_compiler.gc_pause import gc_paused
from sar_compiler.nodes.installed import allow_current_folder, entry_points, import_installed
from sar_compiler.nodes.palettes import load_palettes
from sar_compiler.nodes.spec import MARK, NodeSpec
from sar_compiler.opener import MODULE, read_file
from sar_compiler.tree.content import as_written
from sar_compiler.tree.guessing import did_you_mean, nearest
from sar_compiler.tree.model import SUBTREE_TAG

ENTRY_POINTS = "sar_compiler.nodes"

Named = str | ModuleType | type
"""A module or class of leaves that a user names. A module can be given by its import path."""

_REGISTERS = re.compile(r"^@(\w+\.)*register\(", re.MULTILINE)


class RegistryError(SarError):
    """A module of leaves cannot be loaded, or two classes have the same tag."""


def is_marked(cls: type) -> bool:
    """Return whether a class itself is registered. A subclass of a registered class is not registered."""
    return MARK in vars(cls)


class Registry:
    """The tags that a tree file may use, with their specs."""

    def __init__(self, specs: Iterable[NodeSpec] = ()) -> None:
        self._specs: dict[str, list[NodeSpec]] = {}
        self._installed: dict[str, str] = {}
        for spec in specs:
            self.add(spec)

    def add(self, spec: NodeSpec) -> None:
        """Add the spec of a tag. A variant can be added to the existing specs of the tag.

        Raises:
            RegistryError: If the tag is already registered for another class.
        """
        known = self._specs.setdefault(spec.tag, [])
        if any(_have_same_class(other, spec) for other in known):
            return
        if known and not spec.variant:
            classes = " and ".join(each.factory_path.replace(":", ".") for each in (known[0], spec))
            raise RegistryError(f"two classes are registered as <{spec.tag}>: {classes}")
        known.append(spec)

    def record_entry_point(self, tag: str, entry_point: str) -> None:
        """Record that a tag was registered by an installed entry point instead of the user."""
        self._installed.setdefault(tag, entry_point)

    def tags_like(self, tags: Iterable[str]) -> list[str]:
        """Return the tags to suggest for a file that uses *tags*.

        The tags of an installed module are left out unless the file uses one of them.
        """
        used = {self._installed.get(tag) for tag in tags}
        return [tag for tag in self._specs if tag not in self._installed or self._installed[tag] in used]

    def add_module(self, module: ModuleType) -> int:
        """Add the registered classes and the `SPECS` of a module, and return the number of specs."""
        classes = [value for value in vars(module).values() if isinstance(value, type) and is_marked(value)]
        specs = [*(vars(cls)[MARK] for cls in classes), *getattr(module, "SPECS", ())]
        for spec in specs:
            self.add(spec)
        return len(specs)

    def add_class(self, cls: type) -> None:
        """Add a class that the decorator `register` has marked.

        Raises:
            RegistryError: If the class is not marked, or its tag is already registered for another class.
        """
        if not is_marked(cls):
            name = f"{cls.__module__}.{cls.__qualname__}"
            raise RegistryError(f"{name} is not registered: write @register above the class")
        self.add(vars(cls)[MARK])

    @property
    def tags(self) -> KeysView[str]:
        """All registered tags."""
        return self._specs.keys()

    def __contains__(self, tag: str) -> bool:
        return tag in self._specs

    def __iter__(self) -> Iterator[NodeSpec]:
        return (spec for tag in sorted(self._specs) for spec in self.variants(tag))

    def __getitem__(self, tag: str) -> NodeSpec:
        if tag not in self:
            raise KeyError(tag)
        return self.variants(tag)[0]

    def get(self, tag: str) -> NodeSpec | None:
        """Return the first spec of a tag; None if the tag is unknown."""
        return next(iter(self.variants(tag)), None)

    def variants(self, tag: str) -> list[NodeSpec]:
        """Return all specs of a tag. The attributes of an element determine which of them applies.

        Raises:
            RegistrationError: If the constructor of one of the classes has a parameter that a tree file cannot express.
        """
        found = self._specs.get(tag, [])
        for spec in found:
            spec.parameters  # noqa: B018 - reports errors of the constructor if the tag is used
        return [*found]

    def by_tag(self) -> dict[str, list[NodeSpec]]:
        """Return all specs by tag, in alphabetical order."""
        return {tag: self.variants(tag) for tag in sorted(self._specs)}

    def specs(self) -> list[NodeSpec]:
        """Return all registered specs, for example to create another registry from them."""
        return [spec for variants in self._specs.values() for spec in variants]

    def without_tags(self, tags: Collection[str]) -> "Registry":
        """Return a copy of the registry without the given tags."""
        left = Registry()
        left._specs = {tag: variants for tag, variants in self._specs.items() if tag not in tags}
        left._installed = self._installed
        return left

    def current_tag(self, former_tag: str) -> str | None:
        """Return the current tag of a node that formerly had another tag; None if there is no such node."""
        return next((spec.tag for spec in self.specs() if former_tag in spec.former_tags), None)

    def nearest(self, tag: str) -> str | None:
        """Return the tag that was probably meant by an unknown tag; None without a similar tag."""
        return nearest(tag, self._specs)


@gc_paused()  # imports leave no garbage
def load_registry(
    named: Iterable[Named] = (),
    configured: Iterable[str] = (),
    checkout: Path | None = None,
    palettes: Iterable[str] = (),
) -> Registry:
    """Create the registry of all installed and all requested nodes.

    Args:
        named: The leaves that the user names: classes, modules, or import paths, which may be in the current folder.
        configured: Import paths of modules from a configuration, which are installed or trusted.
        checkout: A folder whose content is not regarded as installed.
        palettes: Names of installed palettes (`nav2:jazzy`). A class registered for a palette's tag replaces the palette's node.

    Raises:
        RegistryError: If a module cannot be imported or has no leaves. The message names the module and the reason.
        PaletteError: If a palette does not exist or cannot be loaded.
    """

    def import_it(module: str) -> ModuleType:
        return import_installed(module, checkout)

    registry = Registry(each for each in language() if each.tag != SUBTREE_TAG)
    for entry_point in entry_points(ENTRY_POINTS, checkout):
        before = set(registry.tags)
        registry.add_module(_import(entry_point.value, f"entry point '{entry_point.name}'", import_it))
        for tag in registry.tags - before:
            registry.record_entry_point(tag, entry_point.value)
    for module in configured:
        _add_import(registry, module, "nodes of the configuration", import_it)
    for each in named:
        if isinstance(each, str):
            allow_current_folder()
            _add_import(registry, each, "--nodes", importlib.import_module)
        elif isinstance(each, ModuleType):
            registry.add_module(each)
        else:
            registry.add_class(each)
    for spec in load_palettes(palettes, checkout):
        if spec.tag not in registry:
            registry.add(spec)
    return registry


@functools.cache
def language() -> list[NodeSpec]:
    """Return the specs of the tree language's built-in nodes, including `SubTree`."""
    from sar_compiler.nodes.language import SPECS

    return SPECS


@functools.cache
def subtree() -> NodeSpec:
    """Return the spec of `SubTree`."""
    return language_variants(SUBTREE_TAG)[0]


@functools.cache
def language_variants(tag: str) -> Sequence[NodeSpec]:
    """Return all specs that the built-in nodes have for a tag."""
    return [each for each in language() if each.tag == tag]


@functools.cache
def is_library_tag(tag: str) -> bool:
    """Return whether a tag is built-in but unknown to BehaviorTree.CPP, such as the tags of py_trees nodes."""
    specs = language_variants(tag)
    return bool(specs) and not any(spec.semantics.counterpart.built_in for spec in specs)


@functools.cache
def default_registry() -> Registry:
    """Return the registry of all installed nodes."""
    return load_registry()


def _add_import(registry: Registry, name: str, source: str, load: Callable[[str], ModuleType]) -> None:
    """Add the leaves of a module named by its import path."""
    if name.endswith(".py") or "/" in name:
        raise RegistryError(f"'{name}' ({source}) is a file; {_as_module(Path(name))}")
    module = _import(name, source, load)
    if not registry.add_module(module):
        hint = did_you_mean(next(_submodules_with_leaves(module), None))
        raise RegistryError(f"the module '{name}' ({source}) registers no node{hint}")


def _as_module(path: Path) -> str:
    """Return a hint to write a module's import path instead of the path of its file."""
    try:
        here = path.resolve().relative_to(Path.cwd())
    except (OSError, ValueError):
        here = Path("..")
    parts = here.with_suffix("").parts
    if not parts or not all(part.isidentifier() for part in parts):
        return "write the import path of a module that is installed or in the current folder: --nodes PKG.MOD"
    return f"write its import path: --nodes {'.'.join(parts)}"


def _submodules_with_leaves(package: ModuleType) -> Iterator[str]:
    """Yield the import paths of a package's modules that register leaves.

    The modules are not imported: their source text is searched.
    """
    for folder in map(Path, getattr(package, "__path__", ())):
        for path in sorted(folder.rglob("*.py")):
            parts = path.relative_to(folder).with_suffix("").parts
            if all(map(str.isidentifier, parts)) and _REGISTERS.search(
                read_file(path, MODULE).data.decode("utf-8", "replace")
            ):
                yield ".".join((package.__name__, *parts))


def registered_leaves(package: str) -> "Registry":
    """Return a registry that contains only the leaves registered by a module or a package's modules.

    Args:
        package: The import path of the module or package, which the user names.

    Raises:
        RegistryError: If a module cannot be imported.
    """
    allow_current_folder()
    found, root = Registry(), _import(package, "--nodes", importlib.import_module)
    for name in (package, *_submodules_with_leaves(root)):
        for thing in vars(_import(name, "--nodes", importlib.import_module)).values():
            if isinstance(thing, type) and thing.__module__ == name and is_marked(thing):
                found.add_class(thing)
    return found


def _import(name: str, source: str, load: Callable[[str], ModuleType]) -> ModuleType:
    try:
        return load(name)
    except (Exception, SystemExit) as error:  # a user's module may raise anything
        wrong = error.msg if isinstance(error, SyntaxError) else error
        text = f"the module of leaves '{name}' ({source}) cannot be imported: {type(error).__name__}: {wrong}"
        raise RegistryError(f"{_location_of(error)}{text}") from error


def _location_of(error: BaseException) -> str:
    """Return the location of an error in a user's module, as `file:line:column: `.

    The result is empty if the module was not found.
    """
    if isinstance(error, SyntaxError) and error.filename:
        return f"{as_written(Path(error.filename))}:{error.lineno or 1}:{error.offset or 1}: "
    import traceback

    ours, standard = str(Path(__file__).parents[1]), str(Path(os.__file__).parent)
    frames = [each for each in traceback.extract_tb(error.__traceback__) if each.filename.endswith(".py")]
    theirs = [each for each in frames if not each.filename.startswith((ours, standard))]
    if not theirs:
        return ""
    last = theirs[-1]
    column = (getattr(last, "colno", None) or 0) + 1  # Python 3.10 lacks it
    return f"{as_written(Path(last.filename))}:{last.lineno}:{column}: "


def _have_same_class(first: NodeSpec, second: NodeSpec) -> bool:
    """Return whether two specs have the same class, without importing the class."""
    if first.is_by_path or second.is_by_path:
        return first.factory_path == second.factory_path
    return first.class_or_path is second.class_or_path

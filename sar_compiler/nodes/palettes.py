"""Installed palettes of other programs' nodes, by name and version (`nav2:jazzy`).

An entry point of the group `sar_compiler.palettes` names a module with `VERSIONS`, the known versions, and
`specs(version)`, which returns the node specs of a version. As with modules of leaves, only installed modules are
imported. A file cannot name the module of a palette.
"""

import functools
import re
from collections.abc import Iterable, Mapping
from pathlib import Path

from sar_compiler.errors import SarError
from sar_compiler.nodes.installed import entry_points, import_installed
from sar_compiler.nodes.spec import NodeSpec, Provenance
from sar_compiler.tree.guessing import nearest

ENTRY_POINTS = "sar_compiler.palettes"
_OWN_PACKAGE = "sar_compiler.nodes."
# A single letter before the colon is a Windows drive.
_NAME = r"[A-Za-z][\w-]+:[\w.-]*"


class PaletteError(SarError):
    """A palette does not exist or cannot be loaded."""


class KnownSpec(NodeSpec):
    """The spec of another program's node. The behaviour of the node is known, not only its model."""

    provenance = Provenance.NAMED
    """The declared outcomes and semantics are known, not assumed."""


def is_palette_name(text: str) -> bool:
    """Return whether a text is the name of an installed palette, such as `nav2:jazzy`, and not a path."""
    return re.fullmatch(_NAME, text) is not None


def load_palettes(names: Iterable[str], checkout: Path | None = None) -> list[NodeSpec]:
    """Return the node specs of palettes. If two versions of a palette are named, the first is used.

    Args:
        names: Names with versions, such as `nav2:jazzy`.
        checkout: A folder whose content is not regarded as installed.

    Raises:
        PaletteError: If there is no such palette or version, or it cannot be loaded.
    """
    versions: dict[str, str] = {}
    for name in names:
        program, _, version = name.partition(":")
        versions.setdefault(program, version)
    return [spec for program, version in versions.items() for spec in _specs_of(program, version, checkout)]


def palettes_containing(tag: str) -> list[str]:
    """Return the names of this package's palettes that contain a tag."""
    return [name for name, tags in _attributes().items() if tag in tags]


def palette_attributes(palette: str, tag: str) -> frozenset[str] | None:
    """Return the attributes of a tag in one of this package's palettes; None if no palette contains the tag."""
    return _attributes().get(palette, {}).get(tag)


def palette_names() -> list[str]:
    """Return the names of this package's palettes, with their versions."""
    return [*_attributes()]


@functools.cache
def _attributes() -> Mapping[str, Mapping[str, frozenset[str]]]:
    """Return the attributes of each tag in this package's palettes, by palette name and tag."""
    found = {}
    for each in entry_points(ENTRY_POINTS):
        if each.module.startswith(_OWN_PACKAGE):
            module = import_installed(each.module)
            for version in module.VERSIONS:
                found[f"{each.name}:{version}"] = {
                    spec.tag: frozenset(spec.parameters) for spec in module.specs(version)
                }
    return found


def _specs_of(program: str, version: str, checkout: Path | None) -> list[NodeSpec]:
    installed = {each.name: each for each in entry_points(ENTRY_POINTS, checkout)}
    if program not in installed:
        known = ", ".join(f"{name}:..." for name in sorted(installed)) or "none"
        message = f"there is no palette '{program}:{version}'{_suggestion(program, installed, ':...')} (installed: {known})"
        raise PaletteError(message)
    try:
        module = import_installed(installed[program].module, checkout)
    except (Exception, SystemExit) as error:  # a foreign module may raise anything
        message = f"the palette '{program}' ({installed[program].value}) cannot be imported: {type(error).__name__}: {error}"
        raise PaletteError(message) from error
    if version not in module.VERSIONS:
        known = ", ".join(f"{program}:{each}" for each in module.VERSIONS)
        near = _suggestion(version, module.VERSIONS, "", f"{program}:")
        raise PaletteError(f"there is no palette '{program}:{version}'{near} (installed: {known})")
    return list(module.specs(version))


def _suggestion(word: str, known: Iterable[str], after: str, before: str = "") -> str:
    near = nearest(word, known)
    return f", did you mean '{before}{near}{after}'?" if near is not None else ""

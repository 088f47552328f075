"""Imports modules from a configuration's folder, but only in the version that the user trusts.

Trust applies to the paths and contents of the configuration file and of every file of the packages (or modules) that it
names. One digest covers all of them, so any change results in another digest. A file named after the digest in the
user's state folder records the trust. Only the files that the digest covers are imported. Bytecode files, which may
differ from the source, are ignored, and so are modules beside the named modules.
"""

import hashlib
import os
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib.abc import MetaPathFinder
from importlib.machinery import (
    EXTENSION_SUFFIXES,
    SOURCE_SUFFIXES,
    ExtensionFileLoader,
    FileFinder,
    ModuleSpec,
    SourceFileLoader,
)
from pathlib import Path
from types import CodeType, ModuleType

from sar_compiler.errors import SarError
from sar_compiler.opener import MODULE, NamedPath, UnreadableFileError, mark_unrepeatable, read_file
from sar_compiler.resources import state_folder

_COMPILED = "__pycache__"


class TrustError(SarError):
    """The user's trust in a configuration cannot be recorded."""


@dataclass(frozen=True)
class ConfigurationCode:
    """The code of the modules that a configuration file names.

    Attributes:
        configuration: The configuration file.
        packages: The names of the top-level packages and modules in the folder of the configuration.
        digests: The SHA-256 digests of the configuration and of each file of the packages. Source code runs only if its
            digest is still the same when it is imported.
    """

    configuration: Path
    packages: frozenset[str]
    digests: Mapping[Path, bytes]

    @classmethod
    def from_configuration(cls, configuration: Path, modules: Iterable[str]) -> "ConfigurationCode":
        """Read the code of the modules that a configuration names.

        Links to files outside of the configuration's folder are left out, so those files cannot be imported.
        """
        mark_unrepeatable()  # a file added to a package ends the trust
        packages = frozenset(module.partition(".")[0] for module in modules)
        folder = configuration.parent
        files = (path for name in packages if name.isidentifier() for path in _files(folder, name))
        inside = [configuration, *(NamedPath.confined_to(path, [folder.resolve()]) for path in files)]
        digests = {}
        for path in inside:
            with suppress(UnreadableFileError):
                digests[Path(path)] = hashlib.sha256(read_file(path, MODULE).all_bytes()).digest()
        return cls(configuration, packages, digests)

    @property
    def is_trusted(self) -> bool:
        """Whether the user trusts exactly this version of the code."""
        return self._record.is_file()

    def trust(self) -> None:
        """Record that the user trusts this version of the code.

        Raises:
            TrustError: If the record cannot be written.
        """
        try:
            self._record.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            self._record.write_text(f"{self.configuration}\n", encoding="utf-8")
        except OSError as error:
            raise TrustError(f"cannot record that {self.configuration} is trusted: {error}") from error

    @property
    def _record(self) -> Path:
        digest = hashlib.sha256()
        for path in sorted(self.digests):
            digest.update(hashlib.sha256(os.fsencode(path)).digest())
            digest.update(self.digests[path])
        return trust_folder() / digest.hexdigest()

    def make_importable(self) -> None:
        """Make these modules importable. They take precedence over other modules with the same names."""
        if not any(isinstance(each, _Finder) and each.content == self for each in sys.meta_path):
            sys.meta_path.insert(0, _Finder(self))


def trust_folder() -> Path:
    """Return the folder that contains a record for each trusted version of code."""
    return state_folder() / "trusted"


def _files(folder: Path, name: str) -> Iterator[Path]:
    yield from folder.glob(f"{name}.*")
    for inner, folders, names in os.walk(folder / name):
        folders[:] = [each for each in folders if each != _COMPILED]
        yield from (Path(inner, each) for each in names)


class _Finder(MetaPathFinder):
    def __init__(self, content: ConfigurationCode) -> None:
        self.content = content

    def find_spec(
        self, fullname: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return the import spec of a module, or None if no trusted package contains the module.

        Raises:
            ModuleNotFoundError: If the module was not part of its package when the package was trusted.
        """
        del target
        if fullname.partition(".")[0] not in self.content.packages:
            return None
        for folder in path or [str(self.content.configuration.parent)]:
            finder = FileFinder(
                folder,
                (self._loader, SOURCE_SUFFIXES),  # type: ignore[arg-type]
                (ExtensionFileLoader, EXTENSION_SUFFIXES),
            )
            spec = finder.find_spec(fullname)
            # A folder without an `__init__` module has no origin.
            if spec is not None and (spec.origin is None or Path(spec.origin) in self.content.digests):
                return spec
        raise ModuleNotFoundError(f"the module {fullname} is not part of the trusted code", name=fullname)

    def _loader(self, fullname: str, path: str) -> "_SourceLoader":
        return _SourceLoader(fullname, path, self.content.digests)


class _SourceLoader(SourceFileLoader):
    def __init__(self, fullname: str, path: str, digests: Mapping[Path, bytes]) -> None:
        super().__init__(fullname, path)
        self._digests = digests

    def get_code(self, fullname: str) -> CodeType:
        """Compile the source code of a module. Ignore bytecode files.

        Raises:
            ImportError: If the source has changed since it was trusted.
        """
        source = self.get_filename(fullname)
        code = read_file(source, MODULE).all_bytes()
        if hashlib.sha256(code).digest() != self._digests[Path(source)]:
            raise ImportError(f"{source} has changed since it was trusted", name=fullname)
        return self.source_to_code(code, source)

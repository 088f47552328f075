"""What colcon calls. All but the description, the shipped files and the compiled kernel is said in pyproject.toml."""

import hashlib
import importlib.util
import json
import os
import re
import sys
from pathlib import Path

from setuptools import Distribution, Extension, setup
from setuptools.command.build_ext import build_ext

SHARE = "share/sar_compiler"
# These are installed below share/sar_compiler, folder by folder.
SHIPPED = ("config", "docs/findings", "examples", "launch", "maps", "rviz", "schemas", "trees", "worlds")


def data_files() -> "list[tuple[str, list[str]]]":
    """Return the files that are installed beside the package, as pairs of a folder and what comes into it."""
    folders = {
        "share/ament_index/resource_index/packages": ["resource/sar_compiler"],
        # `colcon build --symlink-install` calls this file in a folder that has the data files only, so what
        # pyproject.toml is read for is among them.
        SHARE: ["package.xml", "pyproject.toml", "README.md", "LICENSE"],
    }
    for path in sorted(path for top in SHIPPED for path in Path(top).rglob("*")):
        if path.is_file() and "__pycache__" not in path.parts:
            folders.setdefault(f"{SHARE}/{path.parent.as_posix()}", []).append(path.as_posix())
    return list(folders.items())


def description() -> str:
    """Return the README for an index of packages, where a link or a picture of the repository would lead nowhere."""
    text = re.sub(r"!\[.*?\]\(.*?\)\n*", "", Path("README.md").read_text(encoding="utf-8"))
    return re.sub(r"\[([^][]+)\]\((?!https?:)[^)]*\)", r"\1", text)


KERNEL = (Path("sar_compiler/runtime/kernel"), Path("sar_compiler/analysis/state_search"))
RECORD = KERNEL[0] / "compiled.json"
_OF_METADATA = {"dist_info", "egg_info"}
OPTIONS = ("--config-file=", "--ignore-missing-imports", "--follow-imports=silent")


def kernel() -> "list[Extension]":
    """Return the modules of the kernel, for the C compiler.

    The kernel works as it is, too, so no failure on the way is one of the build.
    """
    from mypyc.build import mypycify

    sources = sorted(path for folder in KERNEL for path in folder.glob("*.py") if path.stem != "__init__")
    # A compiled module is used only beside the source that it was made of: as that is before mypyc reads it.
    digests = {
        ".".join(path.with_suffix("").parts): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sources
    }
    arguments = [*OPTIONS, "--python-executable", sys.executable, *map(str, sources)]
    try:
        # As mypy's own setup.py has it: where it need not be fast, half the time of the build can be saved.
        opt_level = os.environ.get("MYPYC_OPT_LEVEL", "3")
        modules = mypycify(arguments, opt_level=opt_level, debug_level="0", group_name="sar_compiler_kernel")
    except (Exception, SystemExit) as error:  # noqa: BLE001 - whatever mypyc cannot do here
        sys.stderr.write(f"the kernel is not compiled: {error}\n")
        return []
    for module in modules:
        module.optional = True
        # What there is to be warned of in C that a program wrote: looking for it takes a third of the time.
        module.extra_compile_args.append("-w")
        # Nobody else calls its functions: so they call each other directly, and small ones are inlined.
        # Python's -Wall has gcc read all the text again for its indentation, whatever -w says: 25 s.
        if os.name != "nt":
            module.extra_compile_args += ["-fvisibility=hidden", "-Wno-misleading-indentation"]
            # No C++ exception passes through it: the tables to unwind its calls are a tenth of it.
            module.extra_compile_args += ["-fno-asynchronous-unwind-tables", "-fno-unwind-tables"]
        # A third of a wheel is the kernel, and a tenth of that are names for debuggers.
        if sys.platform == "linux":
            module.extra_link_args.append("-Wl,--strip-all")
    RECORD.write_text(json.dumps(digests, indent=1) + "\n", encoding="utf-8")
    return modules


class Building(build_ext):
    """Asks mypyc only when something is built: tools call this file for its metadata, too."""

    def finalize_options(self) -> None:
        """Find out what is to be compiled; colcon's `--symlink-install` asks whether there is something or not."""
        self.distribution.ext_modules = kernel() if self.distribution.has_ext_modules() else []
        super().finalize_options()


class WithKernel(Distribution):
    """Has something to compile wherever mypyc is, unless that is not wanted, or only the metadata are."""

    def has_ext_modules(self) -> bool:
        """Return whether there is something to compile."""
        # pip asks for the metadata first, where setuptools would have mypyc tell the names of all sources.
        asked = getattr(self, "commands", [])
        is_wanted = os.environ.get("SAR_KERNEL") != "python" and (not asked or {*asked} - _OF_METADATA)
        return bool(is_wanted) and importlib.util.find_spec("mypyc") is not None


distribution = setup(
    long_description=description(),
    long_description_content_type="text/markdown",
    data_files=data_files(),
    distclass=WithKernel,
    cmdclass={"build_ext": Building},
)
# colcon prints the distribution and reads the values back, which cannot be done with a SpecifierSet.
for holder in (distribution, distribution.metadata):
    holder.python_requires = str(holder.python_requires)

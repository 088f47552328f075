"""Builds a wheel from each interface package that colcon has installed: `wheels.py INSTALLED DIST`, after `colcon build`.

A wheel contains the files that a running program needs: the Python package, the libraries (in `lib` of the environment, like those of the
ROS wheels), the definitions, and the entries of the ament index. It contains no headers and CMake files, because these contain paths of
this machine.

The wheels of other projects' packages, such as `nav2_msgs`, have names of this project, because their names on PyPI belong to
these projects.
"""

import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as ET

OURS = "sar_"
EXCLUDED = (".c", ".pyc")
PYTHON = f"cp{sys.version_info.major}{sys.version_info.minor}"
METADATA = """Metadata-Version: 2.1
Name: {name}
Version: {version}
Summary: {description}
License: {license}
"""
# Not `manylinux`, because it was not checked which system libraries the libraries need.
WHEEL = f"""Wheel-Version: 1.0
Generator: sar_compiler
Root-Is-Purelib: false
Tag: {PYTHON}-{PYTHON}-linux_x86_64
"""


def main(installed: Path, dist: Path) -> None:
    """Write a wheel to *dist* for each package below *installed*."""
    dist.mkdir(parents=True, exist_ok=True)
    for manifest in sorted(installed.glob("*/share/*/package.xml")):
        with tempfile.TemporaryDirectory() as folder:
            fill(Path(folder), manifest)
            command = [sys.executable, "-m", "wheel", "pack", folder, "--dest-dir", str(dist)]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)  # noqa: S603 - fixed arguments


def fill(folder: Path, manifest: Path) -> None:
    """Copy the content of a package's wheel to a folder."""
    package, share = ET.parse(manifest).getroot(), manifest.parent  # noqa: S314 - a file of this project
    values = {entry.tag: " ".join((entry.text or "").split()) for entry in package}
    module, version, prefix = values["name"], values["version"], share.parents[1]
    name = distribution(module)
    data = folder / f"{name}-{version}.data" / "data"
    for path in needed(prefix, module):
        target = data / path.relative_to(prefix)
        if "site-packages" in path.parts:
            target = folder / Path(*path.parts[path.parts.index("site-packages") + 1 :])
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, target)
    info = folder / f"{name}-{version}.dist-info"
    info.mkdir()
    info.joinpath("WHEEL").write_text(WHEEL, encoding="utf-8")
    requirements = "".join(f"Requires-Dist: {each}\n" for each in required(package))
    metadata = METADATA.format(**{**values, "name": name}) + requirements
    info.joinpath("METADATA").write_text(metadata, encoding="utf-8")


def distribution(package: str) -> str:
    """Return the name of an interface package's wheel."""
    return package if package.startswith(OURS) else f"{OURS}compiler_{package}"


def required(package: ET.Element) -> Iterator[str]:
    """Yield the PyPI names of the packages that a package needs at run time."""
    for tag in ("depend", "exec_depend"):
        for entry in package.iter(tag):
            yield f"ros-jazzy-{(entry.text or '').replace('_', '-')}"


def needed(prefix: Path, module: str) -> Iterator[Path]:
    """Yield the files of an installed package that a running program needs."""
    patterns = (
        "lib/*.so",
        f"lib/python3*/site-packages/{module}/**/*",
        "share/ament_index/**/*",
        f"share/{module}/package.xml",
        f"share/{module}/*/*.msg",
        f"share/{module}/*/*.srv",
        f"share/{module}/*/*.action",
    )
    for path in sorted({path for pattern in patterns for path in prefix.glob(pattern)}):
        if path.is_file() and path.suffix not in EXCLUDED and path.parent.name != "parent_prefix_path":
            yield path


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))

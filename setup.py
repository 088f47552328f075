"""What colcon calls. All but the shipped files is said in pyproject.toml."""

from pathlib import Path

from setuptools import setup

SHARE = "share/sar_compiler"
# These stand below share/sar_compiler as they stand here, folder by folder.
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


distribution = setup(data_files=data_files())
# colcon prints the distribution and reads the values back, which cannot be done with a SpecifierSet.
for holder in (distribution, distribution.metadata):
    holder.python_requires = str(holder.python_requires)

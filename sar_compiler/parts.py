"""The optional parts of the package. A distribution may omit any of them."""

import functools
import importlib.util


@functools.cache
def is_part_installed(part: str) -> bool:
    """Return whether a part, such as `analysis`, is installed."""
    return importlib.util.find_spec(f"sar_compiler.{part}") is not None


def missing_part(error: ImportError) -> str | None:
    """Return the part whose absence caused an import error; None if the error has another cause."""
    package, _, module = (error.name or "").partition(".")
    part = module.partition(".")[0]
    return part if package == "sar_compiler" and part and not is_part_installed(part) else None

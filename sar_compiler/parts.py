"""The parts of the package: what is around the core, each of which a distribution may leave out."""

import functools
import importlib.util


@functools.cache
def is_here(part: str) -> bool:
    """Return whether a part, such as `analysis`, is installed."""
    return importlib.util.find_spec(f"sar_compiler.{part}") is not None


def missing_part(error: ImportError) -> str | None:
    """Return which part is missing where an import has failed for that; None if it has failed for another reason."""
    package, _, module = (error.name or "").partition(".")
    part = module.partition(".")[0]
    return part if package == "sar_compiler" and part and not is_here(part) else None

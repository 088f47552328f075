"""What can be wrong with a page."""

from sar_compiler.errors import SarError


class PageError(SarError):
    """A page cannot be served; nothing has moved."""

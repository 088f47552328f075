"""What can be the name of a tag or an attribute, in every form: what XML takes for a name."""

import functools
import re
from xml.parsers import expat

_NAME = re.compile(r"[A-Za-z_:][A-Za-z0-9_:.\-]*")
_PERHAPS = re.compile(r"[A-Za-z0-9_:.\-\u0080-\U0010ffff]+")


@functools.lru_cache(maxsize=1024)
def is_name(text: str) -> bool:
    """Say whether a text can be the name of a tag or an attribute."""
    if _NAME.fullmatch(text):
        return True
    if text.isascii() or not _PERHAPS.fullmatch(text):
        return False
    # Which letters of the world XML allows, expat knows.
    try:
        expat.ParserCreate(encoding="utf-8").Parse(f"<{text}/>".encode("utf-8", "surrogatepass"), True)  # noqa: FBT003
    except expat.ExpatError:
        return False
    return True

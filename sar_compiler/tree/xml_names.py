"""The names that a tag or an attribute can have, in every form: those of XML."""

import functools
import re
from xml.parsers import expat

_NAME = r"[A-Za-z_:][A-Za-z0-9_:.\-]*"
# It takes as long to compile as all others together, and names are seldom in another script.
_PERHAPS = r"[A-Za-z0-9_:.\-\u0080-\U0010ffff]+"


@functools.lru_cache(maxsize=1024)
def is_name(text: str) -> bool:
    """Return whether a text can be the name of a tag or an attribute."""
    if re.fullmatch(_NAME, text):
        return True
    if text.isascii() or not re.fullmatch(_PERHAPS, text):
        return False
    # Which letters of the world XML allows, expat knows.
    try:
        expat.ParserCreate(encoding="utf-8").Parse(f"<{text}/>".encode("utf-8", "surrogatepass"), True)  # noqa: FBT003
    except expat.ExpatError:
        return False
    return True

"""Launch files, and what they load; read as text, because `launch` itself is not on PyPI."""

"""Tests of launch files and the files that they load, read as text because `launch` is not on PyPI."""

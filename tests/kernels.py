"""A mark for tests that need the kernel in Python. The kernel is tested compiled, if it is built, and in Python."""

import pytest

from sar_compiler.runtime.kernel import IS_COMPILED

python_only = pytest.mark.skipif(
    IS_COMPILED, reason="nothing can be derived from a compiled class; SAR_KERNEL=python runs it"
)

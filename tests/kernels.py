"""The kernel is tested twice: compiled, where it is, and as it is."""

import pytest

from sar_compiler.runtime.kernel import IS_COMPILED

python_only = pytest.mark.skipif(
    IS_COMPILED, reason="nothing can be derived from a compiled class; SAR_KERNEL=python runs it"
)

"""Breadth-first search of a tree's states, with the steps of a tick, liveness and probabilities.

mypyc compiles these modules in one group with the modules of `sar_compiler.runtime.kernel`. That package decides
whether the compiled modules are used.
"""

from sar_compiler.runtime import kernel as kernel

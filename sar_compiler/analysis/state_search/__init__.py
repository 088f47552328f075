"""The search of a tree's states, breadth first, with the steps of a tick, liveness and probabilities.

mypyc compiles these modules in one group with those of `sar_compiler.runtime.kernel`, which decides whether the compiled ones are used.
"""

from sar_compiler.runtime import kernel as kernel

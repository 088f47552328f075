"""The names that conditions of properties can use in a tree."""

from sar_compiler.compiler.simulated_tree import SimulatedTree
from sar_compiler.runtime.expressions import Script, name_uses

_FOLDER = "/"


def names_of(simulated: SimulatedTree) -> list[str]:
    """Return the names of the facts, then those of the keys of the main tree that the file shows."""
    instance = simulated.compiled.instance
    prefix = f"{instance.scope.board.prefix}{_FOLDER}"
    given = (name.removeprefix(prefix) for name in instance.scope.board.names())
    keys = [name for name in given if _FOLDER not in name]
    for bound in instance.tree.nodes:
        keys += [*bound.keys.values(), *bound.remapping.keys.values()]
        scripts = [
            value
            for value in (*bound.values.values(), *bound.conditions.values())
            if isinstance(value, Script)
        ]
        keys += [use.name for script in scripts for use in name_uses(script)]
    return list(dict.fromkeys([*simulated.fact_values(), *keys]))

"""The registered nodes of BehaviorTree.CPP and of py_trees."""

from sar_compiler.nodes.spec import NodeSpec


def __getattr__(name: str) -> list[NodeSpec]:
    """Return `SPECS`: what a tag of the language means, and `SubTree`; what makes them is imported with it."""
    if name != "SPECS":
        message = f"module '{__name__}' has no attribute '{name}'"
        raise AttributeError(message, name=name)
    try:
        from sar_compiler.nodes.language import controls, decorators, leaves
    except AttributeError as error:
        # It would be taken for the answer that there is no SPECS.
        message = f"the nodes of the language cannot be imported: {error}"
        raise ImportError(message) from error
    return [*controls.SPECS, *decorators.SPECS, *leaves.SPECS]

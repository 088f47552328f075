"""What a tag means: the registry of controls, decorators and leaves."""

from sar_compiler.nodes.register import register
from sar_compiler.nodes.spec import Kind, Use

__all__ = ["Kind", "Use", "register"]

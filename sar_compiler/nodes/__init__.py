"""The registry of controls, decorators and leaves: the meanings of tags."""

from sar_compiler.nodes.register import register
from sar_compiler.nodes.spec import Kind, Use
from sar_compiler.runtime.answers import Answer

__all__ = ["Answer", "Kind", "Use", "register"]

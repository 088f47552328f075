"""Write a mission as a tree file, check it, run it on ROS 2.

The names in this package and in four of its modules are public and stable. A typical use::

    tree = sar_compiler.load("mission.xml")
    for finding in tree.check():
        print(finding.render())

`sar_compiler.leaves` provides base classes for leaves, controls and decorators, and `sar_compiler.missions` base classes for missions.
`sar_compiler.execution` runs missions, and `sar_compiler.testing` helps to test trees. Every other module is internal and may change.
A name is imported at its first use, so that importing one of these modules is fast and does not need ROS.
"""

from typing import TYPE_CHECKING

from sar_compiler.lazy_exports import lazy

if TYPE_CHECKING:
    from sar_compiler.analysis.simulated import Simulated as Simulated
    from sar_compiler.analysis.verify.verdicts import ProofStatus as ProofStatus
    from sar_compiler.analysis.verify.verdicts import Verdict as Verdict
    from sar_compiler.analysis.verify.verdicts import Verification as Verification
    from sar_compiler.budget import Budget as Budget
    from sar_compiler.budget import Progress as Progress
    from sar_compiler.compiler import CompiledTree as CompiledTree
    from sar_compiler.errors import SarError as SarError
    from sar_compiler.errors import UndecidableError as UndecidableError
    from sar_compiler.groot2.groot2_publisher import Groot2Publisher as Groot2Publisher
    from sar_compiler.loaded_tree import LoadedTree as LoadedTree
    from sar_compiler.loaded_tree import load as load
    from sar_compiler.nodes.registry import Registry as Registry
    from sar_compiler.nodes.registry import RegistryError as RegistryError
    from sar_compiler.opener import UnreadableFileError as UnreadableFileError
    from sar_compiler.ros.host_programs import running_tree as running_tree
    from sar_compiler.ros.runner import TreeRunner as TreeRunner
    from sar_compiler.tree.diagnostic import Diagnostic as Diagnostic
    from sar_compiler.tree.diagnostic import TreeError as TreeError
    from sar_compiler.tree.severity import Severity as Severity

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy(__name__)

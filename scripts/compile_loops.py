"""Compiles the optional loops of numba, so that no node has to: what is compiled stays in a cache on disk."""

import sys

from mlsm_manager.joint_solver.solver_kernel import SolverKernel
from mlsm_manager.surface_map.block_shapes import box_maker
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from node_support.kernels import Kernel
from sonar_processing.filters.outliers import outlier_rules
from sonar_processing.filters.strengths import strength_loops
from sonar_processing.scans.assembler import ScanAssembler
from sonar_processing.scans.parameters import SonarToCloudParameters


def main() -> None:
    """Compile what is not in the cache yet; without numba say so."""
    if SolverKernel.AUTO.resolved is not SolverKernel.NUMBA:
        print("compile_loops: numba is not installed, or has no folder to write to; numpy is used", file=sys.stderr)
        return
    # These are compiled by being asked for.
    outlier_rules(Kernel.NUMBA)
    strength_loops(Kernel.NUMBA)
    ScanAssembler(SonarToCloudParameters(kernel=Kernel.NUMBA))
    MultiLevelSurfaceMap(1.0, kernel=Kernel.NUMBA)
    box_maker(Kernel.NUMBA)


if __name__ == "__main__":
    main()

"""How points are placed, and comparisons found and summed: by numpy, or by compiled loops."""

from typing import Callable, NamedTuple

from mlsm_manager.joint_solver.compare.association import Neighbours, Weighing, weighed
from mlsm_manager.joint_solver.compare.comparisons import Summation, summed
from mlsm_manager.joint_solver.compare.neighbours import NeighbourLists
from mlsm_manager.joint_solver.placing.placement import PlacedPoints, Placing, placed
from mlsm_manager.joint_solver.solver_kernel import SolverKernel
from mlsm_manager.joint_solver.unknowns.normal_equations import Scattering, scattered


class Comparing(NamedTuple):
    """neighbours: takes targets, ascending by scan, and how many scans are searched together. weighed: see Weighing.
    summed: see Summation. scattered: see Scattering. placed: see Placing.
    """

    neighbours: Callable[[PlacedPoints, int], Neighbours]
    weighed: Weighing
    summed: Summation
    scattered: Scattering
    placed: Placing

    @classmethod
    def by(cls, kernel: SolverKernel) -> "Comparing":
        """Return what compares. Raises ImportError, which says what to install, for NUMBA without numba."""
        if kernel.resolved is SolverKernel.NUMPY:
            return cls(NeighbourLists, weighed, summed, scattered, placed)
        from mlsm_manager.joint_solver.compare import compiled_comparisons as compiled
        from mlsm_manager.joint_solver.placing.compiled_placement import placed_compiled

        return cls(
            compiled.CompiledNeighbours, compiled.weighed_compiled, compiled.summed_compiled,
            compiled.scattered_compiled, placed_compiled,
        )  # fmt: skip

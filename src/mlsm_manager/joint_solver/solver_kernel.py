"""What compares points with surfaces: numpy, or compiled loops that find the same but for rounding."""

from enum import Enum

from node_support.numba_cache import has_cache, prepare_cache


class SolverKernel(Enum):
    """AUTO: NUMBA where numba is installed and can keep on disk what it compiles, else NUMPY."""

    AUTO = "AUTO"
    NUMPY = "NUMPY"
    NUMBA = "NUMBA"

    @property
    def resolved(self) -> "SolverKernel":
        """NUMPY or NUMBA, whose loops are loaded and compiled now, so that no scan waits for them.

        Raises ImportError for NUMBA without numba.
        """
        if self is SolverKernel.NUMPY:
            return self
        try:
            # Compiling anew in each run takes longer than most runs save.
            if self is SolverKernel.AUTO and not has_cache():
                return SolverKernel.NUMPY
            prepare_cache()
            import mlsm_manager.joint_solver.compiled.compiled_cells
            import mlsm_manager.joint_solver.compiled.compiled_places
            import mlsm_manager.joint_solver.compiled.compiled_search
            import mlsm_manager.joint_solver.compiled.compiled_sums
            import mlsm_manager.joint_solver.compiled.compiled_weights  # noqa: F401
        except ImportError:
            if self is SolverKernel.NUMBA:
                raise
            return SolverKernel.NUMPY
        return SolverKernel.NUMBA

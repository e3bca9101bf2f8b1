"""What compares points with surfaces: numpy, or compiled loops that find the same but for rounding."""

from enum import Enum


class SolverKernel(Enum):
    """AUTO: NUMBA where numba is installed and can keep on disk what it compiles, else NUMPY."""

    AUTO = "AUTO"
    NUMPY = "NUMPY"
    NUMBA = "NUMBA"

    @property
    def resolved(self) -> "SolverKernel":
        """NUMPY or NUMBA."""
        if self is not SolverKernel.AUTO:
            return self
        try:
            import mlsm_manager.multi_view.compiled_comparisons  # noqa: F401
        except (ImportError, RuntimeError):
            # numba raises a RuntimeError where it finds no folder that it may write to.
            return SolverKernel.NUMPY
        return SolverKernel.NUMBA

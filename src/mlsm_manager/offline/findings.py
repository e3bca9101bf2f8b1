"""What the joint solver found out in a run, besides the path: the calibration, and whether the run can be trusted."""

from dataclasses import dataclass
from typing import Any, Dict, Optional, Sequence

from mlsm_manager.joint_solver.solve.batch_solver import Closed
from mlsm_manager.offline.calibration import Calibration
from mlsm_manager.offline.refinement import Refined
from mlsm_manager.offline.replay import Replayed
from mlsm_manager.offline.trust import Trust, trust
from mlsm_manager.self_check.verdict import Verdict


@dataclass(frozen=True)
class Found:
    """calibration, trust: of the fit of the whole run where there is one. closing: which places it goes back to."""

    calibration: Calibration
    trust: Trust
    closing: Optional[Closed] = None

    @classmethod
    def of(cls, replayed: Replayed, refined: Optional[Refined], further: Sequence[Verdict] = ()) -> "Found":
        """Return what was found in a run that the joint solver has followed; `further`: what other checks say."""
        solver = replayed.solver
        live = Calibration.of_live(solver)
        calibration = live if refined is None else Calibration.of_batch(solver, refined.batch)
        return cls(calibration, trust(replayed, refined, further), None if refined is None else refined.closing)

    def to_mapping(self) -> Dict[str, Any]:
        """Return what summary.json holds of it."""
        loops = {} if self.closing is None else {"loops": self.closing.to_mapping()}
        return {
            "calibration": self.calibration.to_mapping(),
            **self.trust.to_mapping(),
            **loops,
            "trust": self.trust.line,
        }

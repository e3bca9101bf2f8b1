"""What the joint solver found out in a run, besides the path: the calibration, and whether the run can be trusted."""

from dataclasses import dataclass
from typing import Any, Dict, Optional, Sequence

from mlsm_manager.offline.calibration import Calibration
from mlsm_manager.offline.refinement import Refined
from mlsm_manager.offline.replay import Replayed
from mlsm_manager.offline.trust import Trust, trust
from mlsm_manager.self_check.verdict import Verdict


@dataclass(frozen=True)
class Found:
    """Both come from the fit of the whole run where there is one."""

    calibration: Calibration
    trust: Trust

    @classmethod
    def of(cls, replayed: Replayed, refined: Optional[Refined], refitted: Sequence[Verdict] = ()) -> "Found":
        """Return what was found in a run that the joint solver has followed; `refitted`: what other fits of it say."""
        solver = replayed.solver
        live = Calibration.of_live(solver)
        calibration = live if refined is None else Calibration.of_batch(solver, refined.batch)
        return cls(calibration, trust(replayed, refined, refitted))

    def to_mapping(self) -> Dict[str, Any]:
        """Return what summary.json holds of it."""
        return {"calibration": self.calibration.to_mapping(), **self.trust.to_mapping(), "trust": self.trust.line}

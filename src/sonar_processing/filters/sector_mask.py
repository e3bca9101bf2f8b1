"""Removes what is heard in a sector of the vehicle's own hull."""

from dataclasses import dataclass

import numpy as np

from node_support.geometry import FULL_TURN, bearings_of
from node_support.headers import StampParameters
from node_support.parameters import parameter
from sonar_processing.cloud import Cloud, SonarPoses


@dataclass(frozen=True)
class SectorMaskParameters(StampParameters):
    sonar_frame: str = parameter("sonar", "frame of the sonar in tf", tunable=False)
    start_angle: float = parameter(
        0.0, "head angle, counter-clockwise from the sonar's x axis, at which the sector begins", unit="rad",
        low=-FULL_TURN, high=FULL_TURN,
    )  # fmt: skip
    width: float = parameter(
        0.0, "of the sector, counter-clockwise; 0: nothing is removed", unit="rad", low=0.0, high=FULL_TURN
    )
    reach: float = parameter(
        2.0, "distance from the sonar up to which the sector is removed", unit="m", low=0.0, high=1000.0
    )


class SectorMask:
    """Removes the points of a cloud in a sector that turns with the vehicle."""

    def __init__(self, parameters: SectorMaskParameters, sonar_poses: SonarPoses) -> None:
        self._parameters, self._sonar_poses = parameters, sonar_poses

    def __call__(self, cloud: Cloud) -> Cloud:
        """Return the cloud without the sector; raises RefusedInput where nobody knows where the sonar was."""
        parameters = self._parameters
        valid = cloud.valid
        if not parameters.width or not valid.any():
            return cloud
        times, beams = np.unique(np.abs(cloud.time_stamps[valid]), return_inverse=True)
        T_sonar_cloud = np.linalg.inv(self._sonar_poses(cloud.frame_id, times))[beams]
        points = cloud.points[valid, :3].astype(np.float64)
        places = np.einsum("nij,nj->ni", T_sonar_cloud[:, :3, :3], points) + T_sonar_cloud[:, :3, 3]
        turn = np.mod(bearings_of(places) - parameters.start_angle, FULL_TURN)
        inside = (turn <= parameters.width) & (np.linalg.norm(places, axis=1) <= parameters.reach)
        keep = np.ones(len(cloud), dtype=bool)
        keep[valid] = ~inside
        return cloud.select(keep)

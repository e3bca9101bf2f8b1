"""A mounting by parameters puts the beams where the sonar looks."""

import math

import numpy as np
import pytest
from clouds import beam_of

from node_support.parameters import ParameterError
from sonar_processing.beams.parameters import MountingParameters
from sonar_processing.beams.projection import project_beams


def _first_bin(angle, **mounting):
    """Return x y z of the first bin, at 0.5 m, of a beam at a head angle, in the vehicle's frame."""
    T_base_sonar = MountingParameters(**mounting).matrix()
    return project_beams([beam_of(angle=angle)], T_base_sonar[np.newaxis], 1, 0.0)[0, 0, :3]


@pytest.mark.parametrize(
    ("angle", "mounting", "expected"),
    [
        (0.0, {}, (0.5, 0.0, 0.0)),
        (math.pi / 2, {}, (0.0, 0.5, 0.0)),
        (0.0, {"mount_yaw": math.pi / 2}, (0.0, 0.5, 0.0)),
        (math.pi / 2, {"upside_down": True}, (0.0, -0.5, 0.0)),
        (math.pi / 2, {"upside_down": True, "mount_yaw": math.pi / 2}, (0.5, 0.0, 0.0)),
        (0.0, {"mount_x": 1.0, "mount_y": -2.0, "mount_z": 3.0}, (1.5, -2.0, 3.0)),
    ],
)
def test_angle_0_points_along_mount_yaw_and_an_upside_down_head_turns_the_other_way(angle, mounting, expected):
    np.testing.assert_allclose(_first_bin(angle, **mounting), expected, atol=1e-6)


def test_a_mounting_out_of_range_is_refused():
    with pytest.raises(ParameterError, match="mount_x"):
        MountingParameters(mount_x=1000.0)

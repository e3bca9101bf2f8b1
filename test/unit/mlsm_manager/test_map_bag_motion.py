"""What map_bag's command line says of the vehicle's motion."""

import pytest

from mlsm_manager.localisation.odometry_profiles import OdometryKind
from mlsm_manager.offline.map_bag import map_bag_arguments
from recordings.motion.vehicle_motion import MotionSource


def arguments(*words):
    return map_bag_arguments(["a.bag", "--out", "out", *words])


def refusal(capsys, *words):
    with pytest.raises(SystemExit) as ended:
        arguments(*words)
    assert ended.value.code == 2
    return capsys.readouterr().err.splitlines()[-1]


@pytest.mark.parametrize("odometry", [(), ("--odometry", "none")])
def test_an_unknown_motion_means_no_odometry(odometry):
    options = arguments("--unknown-motion", *odometry)
    assert options.odometry is OdometryKind.NONE
    assert options.request.motion.declared is MotionSource.UNKNOWN


def test_standing_leaves_the_odometry_to_the_recording():
    options = arguments("--standing")
    assert options.odometry is None
    assert options.request.motion.declared is MotionSource.STANDING


def test_a_moving_vehicle_is_not_said_to_stand(capsys):
    line = refusal(capsys, "--standing", "--odometry", "none")
    assert "--standing is for a vehicle that did not move" in line
    assert line.endswith("give --unknown-motion instead")


def test_an_unknown_motion_has_no_other_odometry(capsys):
    line = refusal(capsys, "--unknown-motion", "--odometry", "heading")
    assert "--odometry heading: must be none, or left out, with --unknown-motion" in line


def test_a_vehicle_either_stands_or_moves(capsys):
    assert "not allowed with argument --standing" in refusal(capsys, "--standing", "--unknown-motion")

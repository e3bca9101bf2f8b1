"""Writes test/data/basin.bag without a master; same code and seed, same beams."""

import sys
from pathlib import Path

import numpy as np
import rosbag
import rospy
from tf2_msgs.msg import TFMessage

from sonar_processing.transforms import pose_from_matrix
from sonar_simulator.echo_model import make_echo_model
from sonar_simulator.odometry import Odometry, OdometryParameters
from sonar_simulator.poses import pose_matrix
from sonar_simulator.ray_caster import RayCaster
from sonar_simulator.script_file import load_script
from sonar_simulator.sdf import load_sdf
from sonar_simulator.simulation import Simulation
from sonar_simulator.simulator_messages import BASE_FRAME, SONAR_FRAME, moment_messages, transform_message
from sonar_simulator.sonar_head import Sonar, SonarHead, SonarParameters

START_TIME = 1000.0
TICK_RATE = 4.0
SPREAD = 0.15
T_BASE_SONAR = pose_matrix([0.4, 0.0, 0.2])


def simulation(root: Path) -> Simulation:
    """Return the simulation that the bag records."""
    script = load_script(root / "test/data/basin.yaml")
    parameters = SonarParameters()
    model = make_echo_model("laser_cone", {"spread": SPREAD})
    caster = RayCaster(load_sdf(root / "worlds/basin.sdf").world)
    sonar = Sonar(caster, parameters.pattern(), model, np.random.default_rng(1))
    odometry = Odometry(OdometryParameters(scale_error=0.0), script.pose(0.0))
    head = SonarHead(parameters.beams_per_turn, parameters.seconds_per_turn)
    return Simulation(script, odometry, sonar, head, T_BASE_SONAR)


def main(root: Path) -> None:
    """Write the bag."""
    path = root / "test/data/basin.bag"
    simulated = simulation(root)
    with rosbag.Bag(str(path), "w", compression="bz2") as bag:
        start = rospy.Time.from_sec(START_TIME)
        mount = transform_message(pose_from_matrix(T_BASE_SONAR), start, BASE_FRAME, SONAR_FRAME)
        bag.write("/tf_static", TFMessage(transforms=[mount]), start)
        for moment in simulated.moments(TICK_RATE):
            stamp = rospy.Time.from_sec(START_TIME + moment.time)
            for topic, message in moment_messages(moment, stamp, 50.0):
                bag.write(topic if topic.startswith("/") else f"/{topic}", message, stamp)
    print(f"{path}: {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main(Path(sys.argv[1]))

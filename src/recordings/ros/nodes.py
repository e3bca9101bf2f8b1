"""The executables of this package that are nodes."""

import rospy

from node_support.ros.node import run
from recordings.play_arguments import play_arguments
from recordings.ros.bag_player import BagPlayer


def run_play_bag() -> None:
    """Play a bag to its end."""
    options = play_arguments(rospy.myargv()[1:])
    run("play_bag", lambda: BagPlayer(options))

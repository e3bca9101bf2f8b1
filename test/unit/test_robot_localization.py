"""The example for robot_localization."""

import yaml

from node_support import topics
from node_support.files import package_folder


def test_the_example_for_robot_localization_takes_what_there_is_and_leaves_tf_to_mlsm_core():
    example = yaml.safe_load((package_folder() / "yaml/robot_localization.yaml").read_text())
    assert (example["odom0"], example["pose0"]) == (topics.ODOMETRY, topics.MATCHED_POSE)
    assert not example["publish_tf"]
    assert example["world_frame"] == example["map_frame"]
    used = {name: [axis for axis, uses in enumerate(example[f"{name}_config"]) if uses] for name in ("odom0", "pose0")}
    assert used == {"odom0": [6, 7, 11], "pose0": [0, 1, 5]}
    assert {len(example[f"{name}_config"]) for name in used} == {15}

"""What docs/nodes.md and --help say of the nodes that run others in their process."""

from typing import Dict

from node_support.node_description import HostDescription

_PROCESSING = (
    "sonar_to_cloud", "thresholder", "outlier_remover", "echo_extractor", "line_detector", "circle_detector",
    "sonar_image",
)  # fmt: skip

HOSTS: Dict[str, HostDescription] = {
    "sonar_processing": HostDescription(
        "Turns beams into clean clouds, with all stages in one process: clouds are handed on without being copied, and "
        "a topic is serialised only while somebody subscribes to it. See [sonar_processing](sonar_processing.md).",
        _PROCESSING,
    ),
    "mapping": HostDescription(
        "Turns beams into a map, with all stages in one process: clouds are handed on without being copied, and "
        "a topic is serialised only while somebody subscribes to it. See [sonar_processing](sonar_processing.md) "
        "and [matching](matching.md).",
        (*_PROCESSING, "mlsm_core"),
    ),
}

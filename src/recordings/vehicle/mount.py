"""Where the sonar is on the vehicle, where the recording does not tell."""

from typing import List, Tuple

from node_support.geometry import quaternion_of
from recordings.beams.found_beams import FoundBeams
from recordings.transforms.frame_tree import FrameTree
from recordings.transforms.pose_track import PoseTrack
from sonar_processing.beams.mounting import MountingParameters


def mounted(
    tree: FrameTree, base_frame: str, found: FoundBeams, parameters: MountingParameters
) -> Tuple[FrameTree, List[str]]:
    """Return a tree in which every frame of beams is linked to the vehicle, and what was assumed for that."""
    notes = []
    vehicle = parameters.mounted_in or base_frame
    pose = parameters.matrix()
    for frame in sorted({beam.frame_id for beam in found.beams}):
        if tree.way(base_frame, frame) is None:
            tree = tree.with_track(vehicle, frame, PoseTrack.fixed(pose[:3, 3], quaternion_of(pose)))
            notes.append(f"tf does not place {frame} on the vehicle: {_told(parameters, vehicle)}")
    return tree, notes


def _told(one: MountingParameters, vehicle: str) -> str:
    upside_down = ", upside down" if one.upside_down else ""
    return (
        f"taken as mounted in {vehicle} at {one.mount_x:g} {one.mount_y:g} {one.mount_z:g} m, yaw {one.mount_yaw:g} rad"
        f"{upside_down} (--set mount_x, mount_y, mount_z, mount_yaw, upside_down)"
    )

"""7.3: the harbour surveyed by stepping the tilt servo, as blocks, and how far these are from its surfaces."""

import itertools
from importlib import import_module
from typing import List, Mapping

import numpy as np
import yaml
from benchmarks.harness import ROOT

from mlsm_manager.offline.thesis_chain import ThesisChain
from mlsm_manager.surface_map.blocks import Blocks, BlockType
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from node_support.geometry import pose_matrix
from node_support.health import Health
from sonar_processing.beams.beam import Beam, PlacedBeam
from sonar_processing.filters.outliers import OutlierRemover
from sonar_processing.filters.threshold import Thresholder
from sonar_processing.scans.assembler import ScanAssembler
from sonar_processing.scans.tilt_scan import SonarControlParameters, TiltScan
from sonar_simulator.echoes.echo_model import make_echo_model
from sonar_simulator.echoes.ray_caster import RayCaster
from sonar_simulator.simulation.robot import Servo, ServoParameters, tilted
from sonar_simulator.simulation.sonar_head import Sonar, SonarHead, SonarParameters
from sonar_simulator.world.world import World
from sonar_simulator.world.world_file import load_world
from thesis_results.page import joined, prose, table
from thesis_results.pictures import Pictures, drawn_in_space
from thesis_results.thesis_scans import CHAIN, DEFAULTS, PARAMETERS

RESOLUTION = 0.5
_PLACE = (-20.0, 10.0, -2.5)
"""Of the sonar, m: in the corner of the quays."""
_SURVEYS = {
    "short range, 12 m": (2.5, 12.0),
    "long range, 50 m": (2.5, 50.0),
    "long range, fan beam of 22 deg": (22.0, 50.0),
}
"""Height of the beam [deg] and range [m]."""
_THESIS = "`thesis:=true`, long range, 50 m"
_SEEN_FROM = np.radians([-50.0, 38.0])  # direction and elevation: over the open side of the harbour


def make(pictures: Pictures) -> str:
    """Return the section."""
    world = load_world(ROOT / "worlds/harbour.sdf")
    found = {name: surveyed(world, *head) for name, head in _SURVEYS.items()}
    by_thesis = surveyed(world, *_SURVEYS["long range, 50 m"], CHAIN, PARAMETERS.resolution)
    return joined(
        prose(f"""`sonar_control` steps the tilt servo from -60 to 60 degrees and takes a full scan at each step;
        the default chain (Otsu, statistical removal) and a map of {RESOLUTION:g} m cells do the rest; the last column
        is the chain of the thesis into its cells of {PARAMETERS.resolution:g} m. The sonar is
        at ({_PLACE[0]:g}, {_PLACE[1]:g}, {_PLACE[2]:g}) m, in the corner of the quays of `worlds/harbour.sdf`. Compare
        with figures 7.5 and 7.6 of the thesis: near walls fuse into blocks of their whole height, and far ones are
        seen as stripes, one for each step of the servo."""),
        *(
            pictures.save(
                f"survey_{number}", drawn_in_space(blocks, *_SEEN_FROM),
                f"{name.capitalize()}: {len(blocks)} blocks. Light yellow: vertical, red: horizontal.",
            )
            for number, (name, blocks) in enumerate(found.items(), start=1)
        ),
        table(["", *found, _THESIS], _rows([*found.values(), by_thesis], world)),
        prose("""Distances are those of the worst of each block's mean, top and bottom from the nearest surface of
        the world; "within one cell" is that of each map. The thesis gives no numbers for figures 7.5 and 7.6. A fan
        beam tells nothing about the height of its echoes: see [which head for
        heights](sonar_control.md#which-head-for-heights)."""),
    )  # fmt: skip


def surveyed(
    world: World, opening_deg: float, reach: float, chain: ThesisChain = DEFAULTS, resolution: float = RESOLUTION
) -> Blocks:
    """Return the blocks of one sweep of the servo in the default steps, through a chain into a map.

    opening_deg: height of the beam. The rest of the head is that of yaml/sonar_simulator_survey.yaml.
    """
    settings: Mapping = yaml.safe_load((ROOT / "yaml/sonar_simulator_survey.yaml").read_text())
    parameters = SonarParameters.from_mapping({**settings["sonar"], "vertical_opening_deg": opening_deg})
    model = make_echo_model("laser_cone", {**settings["laser_cone"], "max_range": reach})
    sonar = Sonar(RayCaster(world), parameters.pattern(), model, np.random.default_rng(1))
    head, servo = SonarHead(parameters.beams_per_turn, parameters.seconds_per_turn), Servo(ServoParameters())
    control = TiltScan(SonarControlParameters(), 0.0, servo.command, Health("sonar_control", lambda _: None))
    assembler, surface_map = ScanAssembler(chain.clouds), MultiLevelSurfaceMap(resolution)
    threshold, remove = Thresholder(chain.threshold), OutlierRemover(chain.outliers)
    for number in itertools.takewhile(lambda _: not control.sweeps, itertools.count()):
        time, angle = head.time(number), head.angle(number)
        tilt = servo.angle(time)
        control.take_joint(time, tilt)
        control.take_beam(time, angle)
        pose = tilted(pose_matrix(_PLACE), tilt)
        stamp = round(1e9 * (1000.0 + time))
        beam = Beam(stamp, "sonar", angle, sonar.ping(pose, angle), sonar.range_resolution, tilt)
        beam = chain.clouds.corrected(beam)
        cloud = assembler.add(PlacedBeam(beam, pose, is_moving=False))
        if cloud is not None:
            cloud = remove(threshold(cloud))
            surface_map.insert(cloud.points[cloud.valid])
    return surface_map.blocks


def _rows(found: List[Blocks], world: World) -> List[List[str]]:
    errors = [_block_errors(blocks, world) for blocks in found]
    rows = [
        [f"{kind.name.lower()} blocks", *(str(np.count_nonzero(blocks.type == kind)) for blocks in found)]
        for kind in (BlockType.HORIZONTAL, BlockType.VERTICAL)
    ]
    rows.append(["highest block", *(f"{blocks.depth.max():.1f} m" for blocks in found)])
    for name, quantile in (("median", 0.5), ("95 % are below", 0.95)):
        rows.append([f"distance from the surfaces, {name}", *(f"{np.quantile(one, quantile):.2f} m" for one in errors)])
    shares = [100.0 * np.mean(one <= blocks.resolution) for one, blocks in zip(errors, found)]
    rows.append(["blocks within one cell", *(f"{share:.1f} %" for share in shares)])
    return rows


def _block_errors(blocks: Blocks, world: World) -> np.ndarray:
    """Return (n,) the distance [m] from the world's surfaces of the worst of each block's mean, top and bottom."""
    middle = blocks.mean[:, :3]
    top, bottom = middle.copy(), middle.copy()
    top[:, 2], bottom[:, 2] = blocks.height, blocks.bottom
    return np.max([distances(world, points) for points in (middle, top, bottom)], axis=0)


def distances(world: World, points: np.ndarray) -> np.ndarray:
    """Return (n,) distances [m] of points (n, 3) from the nearest surface, which may be seen from inside or outside."""
    scene = import_module("open3d").t.geometry.RaycastingScene()
    scene.add_triangles(world.vertices.astype(np.float32), world.faces.astype(np.uint32))
    return scene.compute_distance(points.astype(np.float32)).numpy()

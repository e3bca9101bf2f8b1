"""A 3-D scan of the basin with the tilting sonar: its blocks against the world."""

import itertools
from pathlib import Path
from types import MappingProxyType
from typing import List, Mapping

import numpy as np
import yaml

from benchmarks.table import Row
from benchmarks.world_distance import distances, nearest_shape
from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from node_support.geometry import pose_matrix
from node_support.health import Health
from sonar_processing.beams.beam import Beam
from sonar_processing.beams.placed_beam import PlacedBeam
from sonar_processing.filters.outliers import OutlierRemover, OutlierRemoverParameters
from sonar_processing.filters.threshold import Thresholder, ThresholderParameters
from sonar_processing.scans.assembler import ScanAssembler
from sonar_processing.scans.parameters import SonarToCloudParameters
from sonar_processing.servo.tilt_scan import SonarControlParameters, TiltScan
from sonar_simulator.echoes.echo_model import make_echo_model
from sonar_simulator.rays.ray_caster import RayCaster
from sonar_simulator.simulation.sonar_head import Sonar, SonarHead, SonarParameters
from sonar_simulator.vehicle.servo import Servo, ServoParameters, tilted
from sonar_simulator.world.sdf import load_sdf
from sonar_simulator.world.world import World

ROOT = Path(__file__).resolve().parents[2]
RESOLUTION = 0.5
NO_CHANGES: Mapping[str, object] = MappingProxyType({})
FAN_BEAM = {"vertical_opening_deg": 22.0}
T_WORLD_SONAR = pose_matrix((40.4, 8.0, -1.8))
WORLD = load_sdf(ROOT / "worlds/basin.sdf").world


class Survey:
    """One sweep of the servo in the default steps, through the default chain into a map; the vehicle stands still."""

    def __init__(
        self, changes: Mapping[str, object], world: World = WORLD, T_world_sonar: np.ndarray = T_WORLD_SONAR,
        echo_changes: Mapping[str, object] = NO_CHANGES,
    ) -> None:  # fmt: skip
        """`changes`, `echo_changes`: of the head and the echo model in yaml/sonar_simulator_survey.yaml."""
        settings = yaml.safe_load((ROOT / "yaml/sonar_simulator_survey.yaml").read_text())
        parameters = SonarParameters.from_mapping({**settings["sonar"], **changes})
        model = make_echo_model("laser_cone", {**settings["laser_cone"], **echo_changes})
        self._sonar = Sonar(RayCaster(world), parameters.pattern(), model, np.random.default_rng(1))
        self._T_world_sonar = T_world_sonar
        self._head = SonarHead(parameters.beams_per_turn, parameters.seconds_per_turn)
        self._servo = Servo(ServoParameters())
        health = Health("sonar_control", lambda _: None)
        self._control = TiltScan(SonarControlParameters(), 0.0, self._servo.command, health)
        self._assembler = ScanAssembler(SonarToCloudParameters())
        self._stages = [Thresholder(ThresholderParameters()), OutlierRemover(OutlierRemoverParameters())]
        self._map = MultiLevelSurfaceMap(RESOLUTION)

    def run(self) -> Blocks:
        """Return the map's blocks after one sweep."""
        for number in itertools.takewhile(lambda _: not self._control.sweeps, itertools.count()):
            time, angle = self._head.time(number), self._head.angle(number)
            tilt = self._servo.angle(time)
            self._control.take_joint(time, tilt)
            self._control.take_beam(time, angle)
            self._take_beam(time, angle, tilt)
        return self._map.blocks

    def _take_beam(self, time: float, angle: float, tilt: float) -> None:
        pose = tilted(self._T_world_sonar, tilt)
        strengths = self._sonar.ping(pose, angle)
        beam = Beam(round(1e9 * (1000.0 + time)), "sonar", angle, strengths, self._sonar.range_resolution, tilt)
        cloud = self._assembler.add(PlacedBeam(beam, pose, is_moving=False))
        if cloud is not None:
            for stage in self._stages:
                cloud = stage(cloud)
            self._map.insert(cloud.points[cloud.valid])


def block_errors(blocks: Blocks, world: World = WORLD) -> np.ndarray:
    """Return (n,) the distance [m] from the world's surfaces of the worst of each block's mean, top and bottom."""
    middle = blocks.mean[:, :3]
    top, bottom = middle.copy(), middle.copy()
    top[:, 2], bottom[:, 2] = blocks.height, blocks.bottom
    return np.max([distances(world, points) for points in (middle, top, bottom)], axis=0)


def share_rows(name: str, blocks: Blocks, wanted: str) -> List[Row]:
    """Return how many blocks are within one cell of the world, of all and by what they show."""
    good = block_errors(blocks) <= RESOLUTION
    parts = np.array([shape.name for shape in WORLD.shapes])[nearest_shape(WORLD, blocks.mean[:, :3])]
    kinds = {"floor": "floor", "walls": "_wall", "buoys": "column"}
    texts = [(kind, good[np.char.find(parts, word) >= 0]) for kind, word in kinds.items()]
    listed = ", ".join(f"{kind} {100.0 * part.mean():.1f} % of {len(part)}" for kind, part in texts if len(part))
    return [
        (f"{name}: blocks within one cell", f"{100.0 * good.mean():.1f} % of {len(good)}", wanted),
        (name, listed, ""),
    ]


def height_row(blocks: Blocks) -> Row:
    """Return the lowest and highest block of what stands upright, and the floor's mean height."""
    parts = np.array([shape.name for shape in WORLD.shapes])[nearest_shape(WORLD, blocks.mean[:, :3])]
    floor = blocks.mean[parts == "basin/floor/box", 2]
    texts = [f"floor {np.mean(floor):.2f}"]
    for kind, word in (("walls", "_wall"), ("buoys", "column")):
        chosen = np.char.find(parts, word) >= 0
        texts.append(f"{kind} {blocks.bottom[chosen].min():.1f} to {blocks.height[chosen].max():.1f}")
    return ("heights found [m]", ", ".join(texts), "floor -5.5, walls -5.5 to 0.5, buoys -5.3 to 0")


def rows() -> List[Row]:
    """Return the figures of a sweep, with the pencil beam of the survey and with the fan beam of an imaging head."""
    pencil = Survey({}).run()
    fan = Survey(FAN_BEAM).run()
    found = [*share_rows("3-D scan, beam 2.5 deg", pencil, ">= 95 %"), height_row(pencil)]
    return found + share_rows("3-D scan, beam 22 deg", fan, "")

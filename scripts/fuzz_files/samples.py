"""One small, sound file of every kind that is read, and the commands that read it."""

from dataclasses import dataclass
from pathlib import Path
from typing import List, Optional, Tuple

import numpy as np
import trimesh
import yaml
from benchmarks.harness import recorded
from made_bags import write_mcap, write_ros1_bag, write_sqlite_bag
from test_any_log import written
from test_driver_log import RECORDS
from test_ping_viewer_next import write as write_ping_viewer_next

from fuzz_files.logs import LogMaker
from mlsm_manager.offline.map_bag import map_bag, map_bag_arguments
from mlsm_manager.offline.replay import ReplayParameters, live_text
from node_support.files import package_folder
from sonar_simulator.simulation.simulate_bag import run_simulate_bag as simulate_bag

FILE, OUT = "FILE", "OUT"
"""Stand in a command for the damaged file and for the folder to write to."""
_READ = (("convert_bag", FILE, f"{OUT}/out.bag"), ("map_bag", FILE, "--inspect"))
_MAPPED = (("map_bag", FILE, "--out", OUT), ("map_bag", FILE, "--out", OUT, "--refine"))
_STANDING = (("convert_bag", FILE, f"{OUT}/out.bag", "--standing"),)
_QUICK = ("--quiet", "--set", "sonar.ray_rows=3", "sonar.ray_columns=1", "clock_rate=4.0")
_SCRIPT = """\
start: {x: -2.5, y: 0.6, z: -1.2, yaw_deg: 0.0}
moves:
  - {wait: 4.0}
  - {x: 2.5, y: 0.3, seconds: 31.6}
"""
_YAML_2015 = {"Thresholder": {"mode": "OTSU", "minThreshold": 50, "OTSUMultiplier": 1.2}}
_TRACK_TIMES = np.arange(999.0, 1040.0, 0.5)
_TANK = ("simulate_bag", "--world", "tank", *_QUICK, "--out", f"{OUT}/out.bag")


@dataclass(frozen=True)
class Sample:
    """A sound file and the commands that read it: a program of nodes/ and its arguments each.

    damaged: the file to damage within `path`, where that is a folder. is_text: also words and numbers are replaced.
    may_be_endless: what is asked for may take hours; such a run is interrupted. maker: makes other files of this kind,
    in place of damages.
    """

    path: Path
    commands: Tuple[Tuple[str, ...], ...]
    is_text: bool = False
    damaged: str = ""
    may_be_endless: bool = False
    maker: Optional[LogMaker] = None

    @property
    def kind(self) -> str:
        """What the sample is called."""
        return self.path.stem


def samples(folder: Path) -> List[Sample]:
    """Write a sample of each kind into `folder` and return them."""
    script = _kept(folder / "script.yaml", _SCRIPT.encode())
    quick = ("--world", "tank", "--script", str(script), *_QUICK)
    bags = [folder / f"{compression}_bag.bag" for compression in ("none", "bz2", "lz4")]
    for bag in bags:
        simulate_bag([*quick, "--out", str(bag), "--compression", bag.stem.partition("_")[0]])
    whole = bags[0]
    beams_only = write_ros1_bag(whole, folder / "beams_only.bag", {"/sonar/raw", "/tf_static"})
    # A track that covers the simulated bag's time.
    places = (f"{time:.3f},{0.08 * (time - 999.0):.3f},0.5,{0.01 * (time - 999.0):.4f}" for time in _TRACK_TIMES)
    table = _kept(folder / "table.csv", "\n".join(["time,x,y,yaw", *places, ""]).encode())
    live = _kept(folder / "live_yaml.yaml", live_text(ReplayParameters(), "odom", "base_link").encode())
    map_bag(map_bag_arguments([str(whole), "--out", str(folder / "mapped")]))
    of_map = (("map_tool", "info", FILE), ("map_tool", "export", FILE, f"{OUT}/map.ply"))
    of_2015 = _kept(folder / "of_2015.yaml", yaml.safe_dump(_YAML_2015).encode())
    # A log of a room, and a maker of others: of real ones where there are some.
    log = folder / "ping_viewer.bin"
    written(log, [(angle % 400, reach, 1) for reach in (15.0, 30.0) for angle in range(0, 800, 2)])
    makers = LogMaker(sorted(recorded("ping360_logs").glob("*.bin")) or [log])
    return [
        *(Sample(bag, _READ) for bag in bags),
        Sample(write_sqlite_bag(whole, folder / "metadata"), _READ, True, "metadata.yaml"),
        Sample(write_sqlite_bag(whole, folder / "sqlite"), _READ, False, "*.db3"),
        Sample(write_mcap(whole, folder / "mcap.mcap"), _READ),
        Sample(write_ping_viewer_next(folder / "ping_viewer_next.mcap", beams=60), _READ),
        Sample(log, (*_MAPPED, *_READ, *_STANDING), maker=makers),
        Sample(_kept(folder / "imagenex.852", b"".join(RECORDS) * 10), _STANDING),
        Sample(table, (("map_bag", str(beams_only), "--vehicle", FILE, "--out", OUT),), is_text=True),
        Sample(live, (("map_bag", str(whole), "--parameters", FILE, "--out", OUT),), is_text=True),
        Sample(folder / "mapped/map.mlsm", of_map),
        Sample(of_2015, (("migrate_yaml", FILE, "--out", OUT),), is_text=True),
        *_of_the_simulator(folder, script),
    ]


def _of_the_simulator(folder: Path, script: Path) -> List[Sample]:
    package, scripted = package_folder(), ("--script", str(script))
    defaults = (package / "yaml/sonar_simulator_default.yaml").read_bytes()
    parameters = _kept(
        folder / "simulator_yaml.yaml", defaults.replace(b"world: worlds/basin.sdf", b"world: worlds/tank.sdf")
    )
    robot = _kept(folder / "urdf.urdf", (package / "urdf/charle.urdf").read_bytes())
    sdf = _kept(folder / "sdf.sdf", (package / "worlds/tank.sdf").read_bytes())
    meshes = [folder / f"mesh_{ending}.{ending}" for ending in ("obj", "stl", "dae")]
    for mesh in meshes:
        trimesh.creation.box(extents=(12.0, 8.0, 6.0)).export(str(mesh))
    world = ("simulate_bag", "--world", FILE, *_QUICK, *scripted, "--out", f"{OUT}/out.bag")
    commands = {
        script: (*_TANK, "--script", FILE),
        parameters: (*_TANK, *scripted, "--parameters", FILE),
        robot: (*_TANK, *scripted, "--robot", FILE),
        **dict.fromkeys([sdf, *meshes], world),
    }
    texts = (".yaml", ".urdf", ".sdf", ".obj", ".dae")
    return [Sample(path, (command,), path.suffix in texts, "", True) for path, command in commands.items()]


def _kept(path: Path, data: bytes) -> Path:
    path.write_bytes(data)
    return path

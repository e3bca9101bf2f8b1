"""One small, sound file of every kind that is read, and the commands that read it."""

import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import List, Optional, Tuple

import numpy as np
import yaml
from benchmarks.harness import recorded
from made_bags import write_mcap, write_ros1_bag, write_sqlite_bag
from test_any_log import written
from test_driver_log import RECORDS
from test_ping_viewer_next import write as write_ping_viewer_next

from fuzz_files.logs import LogMaker
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
    script = _text(folder / "script.yaml", _SCRIPT)
    bags = [_simulated(folder / f"{name}_bag.bag", script, name) for name in ("none", "bz2", "lz4")]
    live = _text(folder / "live_yaml.yaml", live_text(ReplayParameters(), "odom", "base_link"))
    beams_only = write_ros1_bag(bags[0], folder / "beams_only.bag", {"/sonar/raw", "/tf_static"})
    table = ("map_bag", str(beams_only), "--vehicle", FILE, "--out", OUT)
    mapped = ("map_bag", str(bags[0]), "--parameters", FILE, "--out", OUT)
    folders = [
        Sample(write_sqlite_bag(bags[0], folder / name), _READ, is_text, pattern)
        for name, is_text, pattern in (("metadata", True, "metadata.yaml"), ("sqlite", False, "*.db3"))
    ]
    return [
        *(Sample(bag, _READ) for bag in bags),
        *folders,
        Sample(write_mcap(bags[0], folder / "mcap.mcap"), _READ),
        Sample(write_ping_viewer_next(folder / "ping_viewer_next.mcap", beams=60), _READ),
        _log(folder / "ping_viewer.bin"),
        Sample(_bytes(folder / "imagenex.852", b"".join(RECORDS) * 10), _STANDING),
        Sample(_text(folder / "table.csv", _table()), (table,), is_text=True),
        Sample(live, (mapped,), is_text=True),
        Sample(_map(folder, bags[0]), (("map_tool", "info", FILE), ("map_tool", "export", FILE, f"{OUT}/map.ply"))),
        Sample(
            _text(folder / "of_2015.yaml", yaml.safe_dump(_YAML_2015)), (("migrate_yaml", FILE, "--out", OUT),), True
        ),
        *_of_the_simulator(folder, script),
    ]


def _of_the_simulator(folder: Path, script: Path) -> List[Sample]:
    package, scripted = package_folder(), ("--script", str(script))
    parameters = _copied(package / "yaml/sonar_simulator_default.yaml", folder / "simulator_yaml.yaml")
    parameters.write_text(parameters.read_text().replace("world: worlds/basin.sdf", "world: worlds/tank.sdf"))
    robot = _copied(package / "urdf/charle.urdf", folder / "urdf.urdf")
    world = ("simulate_bag", "--world", FILE, *_QUICK, *scripted, "--out", f"{OUT}/out.bag")
    commands = {
        script: (*_TANK, "--script", FILE),
        parameters: (*_TANK, *scripted, "--parameters", FILE),
        robot: (*_TANK, *scripted, "--robot", FILE),
        _copied(package / "worlds/tank.sdf", folder / "sdf.sdf"): world,
        **{_mesh(folder / f"mesh_{ending}.{ending}"): world for ending in ("obj", "stl", "dae")},
    }
    texts = (".yaml", ".urdf", ".sdf", ".obj", ".dae")
    return [Sample(path, (command,), path.suffix in texts, "", True) for path, command in commands.items()]


def _log(path: Path) -> Sample:
    """Return a log of a room, and a maker of others: of real ones where there are some."""
    written(path, [(angle % 400, reach, 1) for reach in (15.0, 30.0) for angle in range(0, 800, 2)])
    real = sorted(recorded("ping360_logs").glob("*.bin"))
    return Sample(path, (*_MAPPED, *_READ, *_STANDING), maker=LogMaker(real or [path]))


def _simulated(path: Path, script: Path, compression: str) -> Path:
    simulate_bag(
        ["--world", "tank", "--script", str(script), "--out", str(path), "--compression", compression, *_QUICK]
    )
    return path


def _table() -> str:
    """Return a track that covers the simulated bag's time."""
    times = np.arange(999.0, 1040.0, 0.5)
    rows = (f"{time:.3f},{0.08 * (time - 999.0):.3f},0.5,{0.01 * (time - 999.0):.4f}" for time in times)
    return "\n".join(["time,x,y,yaw", *rows, ""])


def _map(folder: Path, bag: Path) -> Path:
    from mlsm_manager.offline.map_bag import map_bag, map_bag_arguments

    map_bag(map_bag_arguments([str(bag), "--out", str(folder / "mapped")]))
    return folder / "mapped/map.mlsm"


def _mesh(path: Path) -> Path:
    import trimesh

    trimesh.creation.box(extents=(12.0, 8.0, 6.0)).export(str(path))
    return path


def _text(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def _bytes(path: Path, data: bytes) -> Path:
    path.write_bytes(data)
    return path


def _copied(source: Path, path: Path) -> Path:
    return Path(shutil.copyfile(str(source), str(path)))

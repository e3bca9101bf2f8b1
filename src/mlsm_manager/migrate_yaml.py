"""migrate_yaml: makes one file of today's parameters of the parameter files of 2015."""

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Dict, List, Mapping, Optional, Type

import yaml

from mlsm_manager.localisation.parameters import MlsmCoreParameters
from node_support.files import check_output, package_folder, write_whole
from node_support.help import CommandLine, ending_in_one_line
from node_support.parameters import EXPERT, ParameterError, ParameterSet, read_values
from sonar_processing.filters.outliers import OutlierRemoverParameters
from sonar_processing.filters.threshold import ThresholderParameters
from sonar_processing.scans.parameters import SonarToCloudParameters
from sonar_processing.scans.tilt_scan import SonarControlParameters
from sonar_processing.shapes.lines import LineDetectorParameters

FILE = "parameters.yaml"
NODES: Dict[str, Type[ParameterSet]] = {
    "sonar_to_cloud": SonarToCloudParameters,
    "thresholder": ThresholderParameters,
    "outlier_remover": OutlierRemoverParameters,
    "line_detector": LineDetectorParameters,
    "mlsm_core": MlsmCoreParameters,
    "sonar_control": SonarControlParameters,
}
"""Nodes that had parameter files in 2015."""


@dataclass(frozen=True)
class Key:
    """A parameter `key` of a node of 2015, its `owner`.

    before: its default in the code. here: today's name of the parameter of `node`; empty where there is none.
    remark: why its default is another, what takes its place. also: another parameter that takes the same value.
    """

    owner: str
    node: str
    key: str
    before: Any
    here: str = ""
    remark: str = ""
    also: str = ""

    def taken(self, value: Any) -> Dict[str, Any]:
        """Return names and value of today's parameters; none where there are none."""
        now = _mode(self.owner, value) if self.key == "mode" and isinstance(value, str) else value
        return {name: now for name in (self.here, self.also) if name}


def _mode(owner: str, value: str) -> str:
    """Return today's mode of that of 2015, which was found by its parts."""
    if owner == "SonarToCloud":
        return ("LASER" if "LASER" in value else "SONAR") + ("CONT" if "CONT" in value else "")
    if owner == "Thresholder":
        parts = [part for part in ("OTSU", "FIXED", "PROPORTIONAL") if part in value]
        return "OTSU+PROPORTIONAL" if parts == ["OTSU", "PROPORTIONAL"] else parts[0] if parts else value
    if owner == "OutlierRemover":
        return "STATISTICAL" if "STATISTICAL" in value else "RADIUS"
    return value


TABLE = yaml.safe_load((package_folder() / "migration/names_2015.yaml").read_text(encoding="utf-8"))
_BEAMS = "sonarSubscribeTopic"
_BY_OWNER: Dict[str, Dict[str, Key]] = {
    owner: {key: Key(owner, table["node"], key, **row) for key, row in table["keys"].items()}
    for owner, table in TABLE["parameters"].items()
}
KEYS: List[Key] = [key for keys in _BY_OWNER.values() for key in keys.values()]


def run_migrate_yaml() -> None:
    """Run migrate_yaml with the command line; ends with one line and status 1 when its input is wrong."""
    parser = CommandLine("migrate_yaml", description=__doc__, epilog="docs/from_2015.md lists all names.")
    parser.add_argument("files", type=Path, nargs="+", metavar="OLD.yaml", help="parameter file of 2015")
    parser.add_argument(
        "--out", type=Path, required=True, metavar="DIR", help=f"folder to write {FILE} to; created if missing"
    )
    parser.add_argument("--overwrite", action="store_true", help="replace a file that exists")
    with ending_in_one_line("migrate_yaml", ParameterError):
        print("\n".join(migrated(parser.parse_args())))


def migrated(options: argparse.Namespace) -> List[str]:
    """Write the file, and return what to tell the user. Raises ParameterError and OSError."""
    given: Dict[str, Dict[str, Any]] = {}
    for file in options.files:
        for owner, values in _by_owner(file).items():
            given.setdefault(owner, {}).update(values)
    target = options.out / FILE
    check_output(target, options.files, options.overwrite)
    write_whole(target, migrated_text(given).encode())
    known = [key for owner in given for key in given[owner]]
    kept = sum(not _BY_OWNER[owner][key].here for owner in given for key in given[owner])
    beams = given.get("SonarToCloud", {}).get(_BEAMS)
    arguments = ["bag:=YOUR.bag", "thesis:=true", f"parameters:={target.resolve()}"]
    arguments += [f"beams:={beams}"] if beams else []
    return [
        f"{target}: {len(known) - kept} of {len(known)} values taken over, {kept} kept as comments",
        f"roslaunch underwater_map_construction play_bag.launch {' '.join(arguments)}",
    ]


def migrated_text(given: Mapping[str, Mapping[str, Any]]) -> str:
    """Return today's parameters by node for values of 2015 by the names of their owners, a comment for what has none.

    Raises ParameterError for a value that a node of today would refuse.
    """
    lines = ["# Written by migrate_yaml. The launch files take it as parameters:=FILE, map_bag as --parameters FILE."]
    for owner, values in given.items():
        keys = _BY_OWNER[owner]
        node = next(iter(keys.values())).node
        taken = {name: now for key, value in values.items() for name, now in keys[key].taken(value).items()}
        try:
            nested = NODES[node].nested(NODES[node].by_name(taken)[0])
            NODES[node].from_mapping(nested)
        except ParameterError as error:
            raise ParameterError(f"{owner}: {error}") from error
        lines += ["", f"# {owner}", f"{node}:" if taken else f"{node}: {{}}"]
        kept = {key: value for key, value in values.items() if not keys[key].here}
        lines += [f"  # {_line(key, value)} ({keys[key].remark})" for key, value in kept.items()]
        lines += _indented({key: value for key, value in nested.items() if key != EXPERT}, "  ")
        if EXPERT in nested:
            lines += [f"  {EXPERT}:", *_indented(nested[EXPERT], "    ")]
    return "\n".join(lines) + "\n"


def _indented(values: Mapping[str, Any], indent: str) -> List[str]:
    return [f"{indent}{_line(key, value)}" for key, value in values.items()]


def _line(key: str, value: Any) -> str:
    return yaml.safe_dump({key: value}, default_flow_style=False).strip()


def _by_owner(file: Path) -> Dict[str, Dict[str, Any]]:
    """Return the values of a file by their owners: those that it names, as `rosparam dump` does, or the only one.

    Raises ParameterError for a key that no node of 2015 had.
    """
    values = read_values(file)
    if not (values and all(isinstance(value, Mapping) for value in values.values())):
        values = {file.stem: values}
    found = {}
    for name, part in values.items():
        owner = _owner(name, part)
        if owner is None:
            raise ParameterError(f"{file}: {name}: must be named as one of {', '.join(_BY_OWNER)}")
        unknown = [key for key in part if key not in _BY_OWNER[owner]]
        if unknown:
            raise ParameterError(f"{file}: {unknown[0]}: no parameter of {owner} in 2015")
        found[owner] = dict(part)
    return found


def _owner(name: str, values: Mapping[str, Any]) -> Optional[str]:
    """Return whose values these are: by the name, else by the keys, which then must be of one node only."""
    plain = name.lower().replace("_", "")
    named = [owner for owner in _BY_OWNER if plain.startswith(owner.lower().replace("_", ""))]
    fitting = [owner for owner, keys in _BY_OWNER.items() if values and set(values) <= set(keys)]
    chosen = named or fitting
    return chosen[0] if len(chosen) == 1 else None

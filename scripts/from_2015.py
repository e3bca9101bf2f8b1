"""Writes docs/from_2015.md from the table of the names of 2015, the parameter dataclasses and yaml/thesis.yaml."""

import dataclasses
from typing import Any, Dict, List, Mapping, Type

import yaml

from node_support.names_2015 import KEYS, NAMES, Kind
from node_support.parameters import EXPERT, ParameterSet, describe

_INTRODUCTION = """\
# Coming from the package of 2015

*Written by `scripts/document` from `migration/names_2015.yaml`, the parameter dataclasses and
`yaml/thesis.yaml`; do not edit.*

For those who ran the stack of the thesis: your bags, your parameter files, your topics.

    rosrun underwater_map_construction migrate_yaml SonarToCloud_default.yaml MLSM_Core_default.yaml --out ours
    roslaunch underwater_map_construction play_bag.launch thesis:=true bag:=$PWD/old.bag \\
        beams:=/charle/sonar parameters:=$PWD/ours/parameters.yaml

`migrate_yaml` writes one file, keeps what has no counterpart as a comment that says why, and prints the command
with your names. Bags need [no conversion](../migration/README.md). Beams that are on `/sonar/raw` need no `beams`.

`thesis:=true`, an argument of `vehicle.launch`, `mapping.launch`, `play_bag.launch` and `demo.launch`, sets
everything as the thesis and its code have it, and so does `map_bag --thesis`. All of it stands in
`yaml/thesis.yaml`, each line with the section of the thesis or the file of 2015 that it comes from. `parameters`
goes over it. Without `thesis:=true` the defaults hold; the tables below say why they are others.

![A bag of 2015 under thesis:=true](pictures/from_2015.png)

*A simulated bag with `avora_msgs` on `/charle/sonar` and the five yaml files of 2015, by the two commands above.
Red: map. Yellow: `debug_cloud`. Blue: the cleaned cloud of the same scan, as corrected so far. Pink: a wall.*

That your bag makes a map can be tested; what fails says how far its beams came:

    rostest underwater_map_construction play_bag.test bag:=$PWD/old.bag beams:=/charle/sonar thesis:=true \\
        least_blocks:=1000 most_minutes:=10

The tests of our own recordings look for these in the folder that the environment variable `UMC_DATA` names.

## What is different

- **A bin** is drawn in its middle, half a bin nearer than in 2015. `thesis:=true` draws it at its far end again
  (`bin_place`).
- **A threshold** is strict: a point must be stronger than it. In 2015 equally strong points passed.
- **Walls** were `Wall2DDetector` and `/sonar/walls/...` in the code, `LineDetector` and `/sonar/scan/line` in the
  thesis; here they are called as in the thesis. The orientation of a wall goes all around.
- **The types** of `/MLSM/cloud` and `/MLSM/Markers` are swapped in the list of section 4.5.1. They are as in the
  code: a PointCloud2 and a MarkerArray.
- **One package** takes the place of the suite: `rosrun sonar_processing thresholder` is `rosrun
  underwater_map_construction thresholder`, `rosrun mlsm_manager MLSM_core` is `rosrun underwater_map_construction
  mlsm_core`, `roslaunch mlsm_manager MLSM.launch` is `roslaunch underwater_map_construction mlsm_core.launch`, and so
  on through the tables below; messages are `underwater_map_construction/...` instead of
  `avora_msgs/...`, with the same md5 sums.
- **Matching**: a scan that is matched goes into the map, as the thesis says; the code of 2015 left it out. `map ->
  odom` has a yaw, since still scans are turned too (6.5.6). Echoes that the map does not have do not count: they
  pulled still scans up to 0.2 m along walls
  ([results](results.md#74-three-moves-with-an-odometry-that-is-30--off)). What is corrected of the code stands in
  `src/mlsm_manager/thesis_matching/thesis_matcher.py`.
- **CONT** publishes from the `scan_size`-th beam on, then with every beam.
- **Old names** of topics, and the service `sonar_control`, are there with `thesis:=true`: the node
  [thesis_topics](nodes.md#thesis_topics) offers them, among them `debug_cloud` and walls in PCL's convention.
"""
_PARAMETERS = """\
## Parameters

Empty: no counterpart, or no default. `expert/` is the key that the parameter stands under. "thesis" is what
`thesis:=true` sets, where that is not the default.

| node of 2015 | key | default | node here | key | default | thesis | why |
| --- | --- | --- | --- | --- | --- | --- | --- |"""


def from_2015_page(nodes: Mapping[str, Type[ParameterSet]], thesis: Mapping[str, Any]) -> str:
    """Return the text of the page. nodes: parameters by node. thesis: what yaml/thesis.yaml holds."""
    lines = [_INTRODUCTION]
    for kind in Kind:
        lines += [f"## {kind.value}", "", "| 2015 | here | |", "| --- | --- | --- |"]
        for one in NAMES:
            if one.kind is kind:
                lines.append(f"| {one.before} | {f'`{one.here}`' if one.here else ''} | {one.remark} |")
        lines.append("")
    lines.append(_PARAMETERS)
    rows = [_row(nodes[key.node], thesis.get(key.node, {}), key) for key in KEYS]
    return "\n".join([*lines, *rows, *_settings(nodes)]) + "\n"


def _row(parameters: Type[ParameterSet], thesis: Mapping[str, Any], key: Any) -> str:
    here = default = told = ""
    if key.here:
        field = next(field for field in dataclasses.fields(parameters) if field.name == key.here)
        here, default = f"`{_name(field)}`", _text(parameters().to_mapping()[key.here])
        set_to = {**thesis, **thesis.get(EXPERT, {})}.get(key.here)
        told = "" if set_to is None or _text(set_to) == default else _text(set_to)
    return (
        f"| {key.owner} | {key.key} | {_text(key.before)} | {key.node} | {here} | {default} | {told} | {key.remark} |"
    )


def _settings(nodes: Mapping[str, Type[ParameterSet]]) -> List[str]:
    """Return the table of what the thesis names and its code did not read from a file."""
    owned = {(key.node, key.key) for key in KEYS}
    lines = ["", "What the thesis names, and no parameter file of 2015 had:", "", "| node | thesis | here |"]
    lines.append("| --- | --- | --- |")
    named: Dict[str, Type[ParameterSet]] = dict(sorted(nodes.items()))
    for node, parameters in named.items():
        for field in dataclasses.fields(parameters):
            told = describe(field).thesis_name
            if told and (node, told) not in owned:
                lines.append(f"| {node} | {told} | `{_name(field)}` |")
    return lines


def _name(field: dataclasses.Field) -> str:
    return f"{EXPERT}/{field.name}" if describe(field).expert else field.name


def _text(value: Any) -> str:
    return yaml.safe_dump(value).splitlines()[0] if not isinstance(value, str) else value

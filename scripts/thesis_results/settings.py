"""7: what `thesis:=true` sets, beside the defaults of the package; printed too."""

from typing import Any, List, Mapping

import yaml
from document import LIVE_NODES

from mlsm_manager.offline.thesis_chain import thesis_values
from node_support.parameters import EXPERT
from sonar_simulator.echoes.thesis_models import LaserConeParameters
from thesis_results.page import joined, prose, table
from thesis_results.pictures import Pictures

_SIMULATOR = "sonar_simulator"


def make(_pictures: Pictures) -> str:
    """Return the section."""
    rows = [row for node, values in thesis_values({}).items() for row in _rows(node, values)]
    differing = [row for row in rows if row[2] != row[3]]
    text = joined(
        prose(f"""Chapter 7 is computed with the defaults of this package and, in the columns `thesis:=true`, with
        `yaml/thesis.yaml`, which names a source for each line. Of its {len(rows)} settings
        {len(rows) - len(differing)} are as the defaults; the others:"""),
        table(["node", "parameter", "default", "thesis"], differing),
    )
    print(text)
    return text


def _rows(node: str, values: Mapping[str, Any]) -> List[List[str]]:
    if node == _SIMULATOR:
        ours, told = LaserConeParameters().to_mapping(), values["laser_cone"]
    else:
        ours = LIVE_NODES[node]().to_mapping()
        told = {**{name: value for name, value in values.items() if name != EXPERT}, **values.get(EXPERT, {})}
    return [[node, f"`{name}`", _text(ours[name]), _text(value)] for name, value in told.items()]


def _text(value: Any) -> str:
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return f"{value:g}"
    return str(value) if isinstance(value, str) else yaml.safe_dump(value).splitlines()[0]

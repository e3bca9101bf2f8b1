"""What docs/nodes.md and --help say of every node besides its parameters: its purpose, topics and services.

The table itself is yaml/nodes.yaml.
"""

from dataclasses import dataclass
from enum import Enum
from typing import Dict, Sequence, Tuple

import yaml

from node_support import topics
from node_support.files import package_folder


class Role(Enum):
    """What a node does with a topic, a transform or a service."""

    INPUT = "subscribes"
    OUTPUT = "publishes"
    SERVICE = "serves"


@dataclass(frozen=True)
class Interface:
    """One topic, transform or service; names are relative to the node's namespace unless they begin with / or ~."""

    role: Role
    name: str
    type: str
    text: str


@dataclass(frozen=True)
class NodeDescription:
    """A node's purpose in Markdown; its interfaces, or the nodes that it runs in its process, as they are listed."""

    summary: str
    interfaces: Tuple[Interface, ...] = ()
    hosted: Sequence[str] = ()


# The compiled loader, where PyYAML has it, reads the table in milliseconds.
_TABLE = yaml.load(
    (package_folder() / "yaml/nodes.yaml").read_text(encoding="utf-8"), getattr(yaml, "CSafeLoader", yaml.SafeLoader)
)
NODES: Dict[str, NodeDescription] = {
    name: NodeDescription(
        row["summary"],
        tuple(Interface(Role(role), topic.format_map(vars(topics)), *rest) for role, topic, *rest in row["interfaces"]),
    )
    for name, row in _TABLE["nodes"].items()
}
HOSTS: Dict[str, NodeDescription] = {name: NodeDescription(**row) for name, row in _TABLE["hosts"].items()}
DIAGNOSTICS = Interface(
    Role.OUTPUT, "/diagnostics", "diagnostic_msgs/DiagnosticArray", "counters and problems, once a second"
)
"""What every node publishes."""

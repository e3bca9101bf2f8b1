"""How a node is described: its purpose and its topics, transforms and services."""

from dataclasses import dataclass
from enum import Enum
from typing import Tuple


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
    """A node's purpose in Markdown and its interfaces, in the order in which they are listed."""

    summary: str
    interfaces: Tuple[Interface, ...]


@dataclass(frozen=True)
class HostDescription:
    """A node that runs other nodes in its process: its purpose in Markdown and the names of those nodes."""

    summary: str
    hosted: Tuple[str, ...]

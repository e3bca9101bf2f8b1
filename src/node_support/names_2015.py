"""What the package of 2015 had, and what stands for it here: migration/names_2015.yaml, read once."""

from dataclasses import dataclass
from enum import Enum
from typing import Any, List

import yaml

from node_support.files import package_folder


class Kind(Enum):
    """What a name names."""

    NODE = "Nodes and nodelets"
    LAUNCH = "Launch files"
    TOPIC = "Topics"
    SERVICE = "Services"
    FIELD = "Fields of messages"


@dataclass(frozen=True)
class Name:
    """before: the name of 2015. here: today's; empty where there is none. remark: what else is different."""

    kind: Kind
    before: str
    here: str = ""
    remark: str = ""


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

    def taken(self, value: Any) -> Any:
        """Return today's value of that of 2015, whose modes were found by their parts."""
        return _MODES[self.owner](value) if self.key == "mode" and self.owner in _MODES else value


def _scan_mode(value: str) -> str:
    return ("LASER" if "LASER" in value else "SONAR") + ("CONT" if "CONT" in value else "")


def _threshold_mode(value: str) -> str:
    parts = [part for part in ("OTSU", "FIXED", "PROPORTIONAL") if part in value]
    return "OTSU+PROPORTIONAL" if parts == ["OTSU", "PROPORTIONAL"] else parts[0] if parts else value


def _outlier_mode(value: str) -> str:
    return "STATISTICAL" if "STATISTICAL" in value else "RADIUS"


_MODES = {"SonarToCloud": _scan_mode, "Thresholder": _threshold_mode, "OutlierRemover": _outlier_mode}
_TABLE = yaml.safe_load((package_folder() / "migration/names_2015.yaml").read_text(encoding="utf-8"))

KEYS: List[Key] = [
    Key(owner, table["node"], key, **row)
    for owner, table in _TABLE["parameters"].items()
    for key, row in table["keys"].items()
]
NAMES: List[Name] = [
    Name(Kind(kind), before, **row) for kind, rows in _TABLE["names"].items() for before, row in rows.items()
]

"""Writes the commented default yaml and the documentation's table of a `ParameterSet`."""

import dataclasses
import textwrap
from enum import Enum
from typing import List, Mapping, Tuple, Type

import yaml

from node_support.parameters import EXPERT, ParameterSet, describe

_FOR_EXPERTS = "hardly ever changed: each with the reason for its default"
_YAML_WIDTH = 110
_YAML_TYPES = {float: "float", int: "int", bool: "bool", str: "string"}


def default_yaml(node: str, parameters: Type[ParameterSet]) -> str:
    """Return the text of yaml/<node>_default.yaml: every key with its meaning, what is allowed, and its default."""
    lines = [f"# Defaults of {node}. Keys marked * can be changed while it runs (dynamic_reconfigure)."]
    return "\n".join(lines + yaml_keys(parameters, live=True)) + "\n"


def start_up_yaml(node: str, parameters: Type[ParameterSet], groups: Mapping[str, Type[ParameterSet]]) -> str:
    """Return the text for a node that reads its parameters only when it starts: its own keys, then those of groups."""
    lines = [f"# Defaults of {node}, read only at start-up.", *yaml_keys(parameters, live=False)]
    for name, group in groups.items():
        lines += ["", f"{name}:"]
        lines += [f"  {line}" if line else "" for line in yaml_keys(group, live=False)[1:]]
    return "\n".join(lines) + "\n"


def yaml_keys(parameters: Type[ParameterSet], live: bool) -> List[str]:
    """Return the lines of all keys, those for experts last; `live` marks those that dynamic_reconfigure may change."""
    plain, experts = _by_audience(parameters)
    lines = [line for field in plain for line in _yaml_key(field, live)]
    if experts:
        lines += ["", f"# {_FOR_EXPERTS}", f"{EXPERT}:"]
        lines += [f"  {line}" if line else "" for field in experts for line in _yaml_key(field, live)]
    return lines


def _yaml_key(field: dataclasses.Field, live: bool) -> List[str]:
    described = describe(field)
    mark = " *" if described.tunable and live else ""
    thesis = f"; thesis: {described.thesis_name}" if described.thesis_name else ""
    reason = [f"#   default: {described.expert}"] if described.expert else []
    text = [f"# {line}" for line in textwrap.wrap(described.text + mark, _YAML_WIDTH)]
    allowed = f"#   {described.allowed(field.type)}{thesis}"
    return ["", *text, allowed, *reason, f"{field.name}: {_yaml_value(field.default)}"]


def _by_audience(parameters: Type[ParameterSet]) -> Tuple[List[dataclasses.Field], List[dataclasses.Field]]:
    """Return the fields that a user meets, and those for experts."""
    fields = dataclasses.fields(parameters)
    return [one for one in fields if not describe(one).expert], [one for one in fields if describe(one).expert]


def markdown_table(parameters: Type[ParameterSet], live: bool = True) -> str:
    """Return the parameter table of a node: name, type, default, what is allowed, unit, thesis name, meaning.

    `live` marks those that dynamic_reconfigure may change. Those for experts come last, with a reason for the default.
    """
    rows = [
        "| parameter | type | default | allowed | unit | thesis | meaning |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    plain, experts = _by_audience(parameters)
    for field in plain + experts:
        described = describe(field)
        name = f"{EXPERT}/{field.name}" if described.expert else field.name
        meaning = f"{described.text}. Default: {described.expert}" if described.expert else described.text
        kind = "string" if issubclass(field.type, Enum) else _YAML_TYPES[field.type]
        allowed = described.allowed(field.type)
        unit = described.unit
        if unit and allowed.endswith(f" {unit}"):
            allowed = allowed[: -len(unit) - 1]
        star = " *" if described.tunable and live else ""
        cells: List[str] = [
            f"`{name}`{star}", kind, f"`{_yaml_value(field.default)}`", allowed, unit, described.thesis_name, meaning,
        ]  # fmt: skip
        rows.append("| " + " | ".join(cells) + " |")
    return "\n".join(rows) + "\n"


def _yaml_value(value: object) -> str:
    if isinstance(value, Enum):
        return f'"{value.value}"'
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f'"{value}"'
    # yaml 1.1 takes 7e-05 for a text.
    return yaml.safe_dump(value).splitlines()[0]

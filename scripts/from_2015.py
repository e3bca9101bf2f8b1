"""Writes the tables of docs/from_2015.md from the names of 2015, the parameter dataclasses and yaml/thesis.yaml."""

import dataclasses
from typing import Any, Dict, List, Mapping, Type

import yaml

from mlsm_manager.migrate_yaml import KEYS, TABLE
from node_support.parameters import EXPERT, ParameterSet, describe

_PARAMETERS = """\
## Parameters

Empty: no counterpart, or no default. `expert/` is the key that the parameter stands under. "thesis" is what
`thesis:=true` sets, where that is not the default.

| node of 2015 | key | default | node here | key | default | thesis | why |
| --- | --- | --- | --- | --- | --- | --- | --- |"""


def from_2015_tables(nodes: Mapping[str, Type[ParameterSet]], thesis: Mapping[str, Any]) -> str:
    """Return the page from its first table on. nodes: parameters by node. thesis: what yaml/thesis.yaml holds."""
    lines: List[str] = []
    for kind, names in TABLE["names"].items():
        lines += [f"## {kind}", "", "| 2015 | here | |", "| --- | --- | --- |"]
        for before, now in names.items():
            here = f"`{now['here']}`" if "here" in now else ""
            lines.append(f"| {before} | {here} | {now.get('remark', '')} |")
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

"""Parameters from yaml files and from KEY=VALUE on a command line."""

from pathlib import Path
from typing import Any, Dict, Iterable, Mapping, Tuple

import yaml

from node_support.parameters import ParameterError


def read_values(path: Path) -> Dict[str, Any]:
    """Return the values of a yaml file by their keys. Raises ParameterError, which names the file."""
    try:
        values = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ParameterError(f"{path}: {error.strerror}") from error
    except (ValueError, RecursionError, yaml.YAMLError) as error:
        # The library raises ValueError for dates that do not exist, RecursionError for what is nested too deeply.
        raise ParameterError(f"{path}: not yaml: {' '.join(str(error).split())}") from error
    if not isinstance(values, Mapping) or not all(isinstance(key, str) for key in values):
        raise ParameterError(f"{path}: must hold lines of KEY: VALUE")
    return dict(values)


def assigned_values(texts: Iterable[str]) -> Dict[str, Any]:
    """Return the values of texts KEY=VALUE, which are yaml, by their keys; the last one of a key counts.

    Raises ParameterError for a text without key, without = or whose value is no yaml.
    """
    return dict(_assigned(text) for text in texts)


def _assigned(text: str) -> Tuple[str, Any]:
    key, equals, value = text.partition("=")
    if not (key and equals):
        raise ParameterError(f"--set {text}: must be KEY=VALUE")
    try:
        return key, yaml.safe_load(value)
    except yaml.YAMLError as error:
        raise ParameterError(f"--set {text}: {value!r} is no yaml value") from error

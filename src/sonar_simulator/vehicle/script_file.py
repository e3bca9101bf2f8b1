"""Reads a vehicle's script from a yaml file: `start`, a mapping, and `moves`, a list."""

from pathlib import Path
from typing import Union

import yaml

from sonar_simulator.vehicle.scripted_vehicle import ScriptError, VehicleScript

_KEYS = ("start", "moves")


def load_script(path: Union[str, Path]) -> VehicleScript:
    """Return the script in a file. Raises ScriptError, naming the file, if it cannot be read or followed."""
    try:
        data = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise ScriptError(f"{path}: {error.strerror}") from error
    except (UnicodeDecodeError, yaml.YAMLError) as error:
        raise ScriptError(f"{path}: not yaml: {' '.join(str(error).split())}") from error
    if not isinstance(data, dict) or set(data) - set(_KEYS):
        raise ScriptError(f"{path}: must hold the keys {' and '.join(_KEYS)} and no others")
    try:
        return VehicleScript.from_yaml_data(data.get("moves"), data.get("start"))
    except ScriptError as error:
        raise ScriptError(f"{path}: {error}") from error

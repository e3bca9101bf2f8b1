"""Parameters as frozen dataclasses that validate themselves; no value is checked anywhere else.

A stage declares its parameters once::

    @dataclass(frozen=True)
    class RadiusParameters(ParameterSet):
        radius: float = parameter(1.0, "neighbourhood of a point", unit="m", low=0.0, high=100.0)

From that declaration come the start-up check, the refusal at run time and the dynamic_reconfigure description. Values
come from the parameter server, from yaml files and from KEY=VALUE on a command line.

A parameter that hardly anybody needs to change gives the reason for its default as `expert`. Yaml files and the
parameter server hold such parameters in a mapping of their own, under the key `expert`.
"""

import dataclasses
import math
from difflib import get_close_matches
from enum import Enum
from functools import lru_cache
from pathlib import Path
from typing import Any, Callable, Dict, Iterable, List, Mapping, Optional, Tuple, Type, TypeVar

import yaml

from node_support.files import package_folder

EXPERT = "expert"
"""The key under which yaml files and the parameter server hold the parameters for experts."""
OLD_KEYS = "parameters of an older version"
"""Begins the warning that names them."""
_OLD_VALUES = {("estimator", "SCAN_BY_SCAN"): "JOINT"}  # values of today by key and older value
_METADATA_KEY = "parameter"
Self = TypeVar("Self", bound="ParameterSet")
Part = TypeVar("Part", bound="ParameterSet")


class ParameterError(ValueError):
    """A parameter is unknown or its value is not allowed; the text names key, value and what is allowed."""


@dataclasses.dataclass(frozen=True)
class Description:
    """What is known of one parameter besides its name, type and default.

    `low` and `high` are inclusive; `tunable` parameters can be changed while the node runs (dynamic_reconfigure),
    the others only at start-up; `may_be_empty` allows an empty string; `thesis_name` is the parameter's name in the
    2015 package; `expert` is the reason for the default of a parameter that hardly anybody needs to change.
    """

    text: str
    unit: str = ""
    low: Optional[float] = None
    high: Optional[float] = None
    thesis_name: str = ""
    tunable: bool = True
    may_be_empty: bool = False
    expert: str = ""

    def allowed(self, kind: type) -> str:
        """Return in words which values a parameter of type `kind` takes."""
        if issubclass(kind, Enum):
            return "one of " + ", ".join(member.value for member in kind)
        if kind is bool:
            return "true or false"
        if kind is str:
            return "a string" if self.may_be_empty else "a non-empty string"
        number = "an integer" if kind is int else "a number"
        bounds = [f"{word} {end:.12g}" for word, end in (("from", self.low), ("to", self.high)) if end is not None]
        unit = f" {self.unit}" if self.unit else ""
        return " ".join([number, *bounds]) + unit


def parameter(default: Any, text: str, **details: Any) -> Any:
    """Declare one field of a `ParameterSet`; `details` are fields of its `Description`."""
    return dataclasses.field(default=default, metadata={_METADATA_KEY: Description(text, **details)})


def describe(field: dataclasses.Field) -> Description:
    """Return the description that `parameter` left in a dataclass field. Raises KeyError for any other field."""
    return field.metadata[_METADATA_KEY]


@dataclasses.dataclass(frozen=True)
class ParameterSet:
    """Base of all parameter dataclasses: every instance that exists holds allowed values only."""

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            # Fields that `parameter` did not declare hold objects that were validated where they were made.
            if _METADATA_KEY in field.metadata:
                object.__setattr__(self, field.name, _validated(field, getattr(self, field.name)))
        self.check()

    def check(self) -> None:
        """Raise ParameterError when values that are allowed one by one do not fit together."""

    @classmethod
    def from_mapping(cls: Type[Self], values: Mapping[str, Any]) -> Self:
        """Build from plain values (yaml, parameter server); keys that are left out keep their defaults.

        Raises ParameterError for an unknown key or a value that is not allowed.
        """
        return cls(**cls.by_name(values)[0])

    @classmethod
    def by_name(cls, values: Mapping[str, Any]) -> Tuple[Dict[str, Any], List[str]]:
        """Return plain values by the names of the parameters, and a remark on each key or value of an older version.

        A key beside `expert` goes before the same one under it, and an older name before the newer one: whoever gives
        them wants something else than the default files, which hold the others. Raises ParameterError for a key that
        never was a parameter.
        """
        known = [field.name for field in dataclasses.fields(cls)]
        experts = values.get(EXPERT, {})
        if not isinstance(experts, Mapping):
            raise ParameterError(f"{EXPERT} = {experts!r}: must be keys and values")
        given = {**experts, **{key: value for key, value in values.items() if key != EXPERT}}
        for key in given:
            if not isinstance(key, str):
                raise ParameterError(f"{key!r} = {given[key]!r}: no such parameter; names are words")
        found, remarks = {key: value for key, value in given.items() if key in known}, []
        for key in [key for key in given if key not in known]:
            renamed, gone = (old_keys()[what].get(key) for what in ("renamed", "gone"))
            if renamed in known:
                found[renamed] = given[key]
                remarks.append(f"{key} -> {renamed}")
            elif gone:
                remarks.append(f"{key} -> nothing ({gone})")
            else:
                guess = "".join(f"did you mean {name}? " for name in get_close_matches(key, known, n=1))
                text = f"{key} = {given[key]!r}: no such parameter; {guess}there are {', '.join(known)}"
                raise ParameterError(text)
        for key, value in found.items():
            if isinstance(value, str) and (key, value) in _OLD_VALUES:
                found[key] = _OLD_VALUES[key, value]
                remarks.append(f"{key} = {value} -> {found[key]}")
        return found, remarks

    @classmethod
    def nested(cls, values: Mapping[str, Any]) -> Dict[str, Any]:
        """Return values by the names of parameters as yaml files hold them: those for experts under `expert`."""
        names = cls.expert_names()
        plain = {key: value for key, value in values.items() if key not in names}
        experts = {key: value for key, value in values.items() if key in names}
        return {**plain, EXPERT: experts} if experts else plain

    @classmethod
    def expert_names(cls) -> List[str]:
        return [field.name for field in dataclasses.fields(cls) if describe(field).expert]

    @classmethod
    def from_group(cls: Type[Self], name: str, values: Any) -> Self:
        """Build as `from_mapping` does from the keys of one group; errors name the group."""
        if not isinstance(values, Mapping):
            raise ParameterError(f"{name} = {values!r}: must be keys and values")
        try:
            return cls.from_mapping(values)
        except ParameterError as error:
            raise ParameterError(f"{name}: {error}") from error

    def changed(self: Self, changes: Mapping[str, Any]) -> Self:
        """Return a copy with `changes` applied and everything validated again."""
        return type(self).from_mapping({**self.to_mapping(), **changes})

    def to_mapping(self) -> Dict[str, Any]:
        """Return plain values (enumerations by value), as yaml and the parameter server hold them."""
        return {field.name: _plain(getattr(self, field.name)) for field in dataclasses.fields(self)}

    def part(self, kind: Type[Part]) -> Part:
        """Return the parameters of one of the sets that this one is made of."""
        return kind(**{field.name: getattr(self, field.name) for field in dataclasses.fields(kind)})

    @classmethod
    def tunable_fields(cls) -> Tuple[dataclasses.Field, ...]:
        """Return the fields that may change while the node runs."""
        return tuple(field for field in dataclasses.fields(cls) if describe(field).tunable)


@lru_cache(maxsize=None)
def old_keys() -> Mapping[str, Mapping[str, str]]:
    """Return what migration/old_keys.yaml says: of `renamed` keys the names of today, of those `gone` why."""
    return yaml.safe_load((package_folder() / "migration/old_keys.yaml").read_text(encoding="utf-8"))


def config_name(node: str) -> str:
    """Return the name of a node's dynamic_reconfigure description: OutlierRemover of outlier_remover."""
    return node.title().replace("_", "")


def with_defaults(**defaults: Any) -> Callable[[type], type]:
    """Give a `ParameterSet` other defaults for parameters that it inherits; texts, units and ranges stay::

        @dataclass(frozen=True)
        @with_defaults(radius=2.0)
        class WideRadiusParameters(RadiusParameters):
            ...

    Raises ParameterError for a name that is not inherited or a default that is not allowed.
    """

    def changed(derived: type) -> type:
        inherited = {field.name: field for base in derived.__bases__ for field in dataclasses.fields(base)}
        annotations = dict(vars(derived).get("__annotations__", {}))
        for name, value in defaults.items():
            if name not in inherited:
                raise ParameterError(f"{name} = {value!r}: {derived.__name__} inherits no such parameter")
            field = inherited[name]
            annotations[name] = field.type
            setattr(derived, name, dataclasses.field(default=_validated(field, value), metadata=field.metadata))
        derived.__annotations__ = annotations
        return derived

    return changed


def _validated(field: dataclasses.Field, value: Any) -> Any:
    description = describe(field)
    try:
        typed = _converted(field.type, value)
    except (TypeError, ValueError, OverflowError):
        typed = None
    missing = typed is None or (typed == "" and not description.may_be_empty)
    if missing or not _in_range(typed, description):
        raise ParameterError(f"{field.name} = {_plain(value)!r}: must be {description.allowed(field.type)}")
    return typed


def _converted(kind: type, value: Any) -> Any:
    if issubclass(kind, Enum):
        return kind(value)
    if kind is float and isinstance(value, (int, float)) and not isinstance(value, bool):
        return float(value)
    if type(value) is kind:
        return value
    raise TypeError(value)


def _in_range(value: Any, description: Description) -> bool:
    if isinstance(value, (str, bool, Enum)):
        return True
    if isinstance(value, float) and not math.isfinite(value):
        return False
    low, high = description.low, description.high
    return (low is None or value >= low) and (high is None or value <= high)


def _plain(value: Any) -> Any:
    return value.value if isinstance(value, Enum) else value


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
    values = {}
    for text in texts:
        key, equals, value = text.partition("=")
        if not (key and equals):
            raise ParameterError(f"--set {text}: must be KEY=VALUE")
        try:
            values[key] = yaml.safe_load(value)
        except yaml.YAMLError as error:
            raise ParameterError(f"--set {text}: {value!r} is no yaml value") from error
    return values

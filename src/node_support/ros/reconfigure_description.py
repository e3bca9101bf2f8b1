"""Turns a `ParameterSet` into a dynamic_reconfigure description; the .cfg files consist of one call of it."""

from enum import Enum
from typing import Type

from dynamic_reconfigure.parameter_generator_catkin import ParameterGenerator, bool_t, double_t, int_t, str_t

from node_support.files import PACKAGE
from node_support.parameters import ParameterSet, describe

_TYPES = {float: double_t, int: int_t, bool: bool_t, str: str_t}


def generator(parameters: Type[ParameterSet]) -> ParameterGenerator:
    """Return a generator that holds every tunable field of `parameters`, with defaults, ranges and choices."""
    result = ParameterGenerator()
    for field in parameters.tunable_fields():
        described = describe(field)
        text = f"{described.text} [{described.unit}]" if described.unit else described.text
        if issubclass(field.type, Enum):
            choices = [result.const(m.name, str_t, m.value, m.name.lower()) for m in field.type]
            result.add(field.name, str_t, 0, text, field.default.value, edit_method=result.enum(choices, text))
        else:
            result.add(field.name, _TYPES[field.type], 0, text, field.default, described.low, described.high)
    return result


def generate(parameters: Type[ParameterSet], name: str) -> int:
    """Write the dynamic_reconfigure files of `name`; return the exit status a .cfg file must end with."""
    return generator(parameters).generate(PACKAGE, PACKAGE, name)

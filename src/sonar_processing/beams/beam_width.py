"""The width of a beam, which several nodes take as a parameter."""

from typing import Any

from node_support.parameters import parameter

# Imagenex 852: 2.5 degrees (thesis 4.1).
_IMAGENEX_852 = 0.0436


def beam_width_parameter(text: str = "horizontal width of the beam") -> Any:
    """Declare the field `beam_width` of a ParameterSet."""
    return parameter(_IMAGENEX_852, text, unit="rad", low=0.0, high=0.5)

"""How surfaces reflect sound: the materials that a world file can name."""

from dataclasses import dataclass
from typing import Dict, Tuple

Colour = Tuple[float, float, float, float]


@dataclass(frozen=True)
class Material:
    """The acoustic properties of a surface at high frequencies.

    reflection: share of the pressure reflected at normal incidence, 0 to 1, from the impedances of water and
        material: (Z - Zw) / (Z + Zw).
    slope: rms slope of the surface's facets (tangent); small is like a mirror, large scatters sound in all directions.
    lambert_db: strength of Lambert's diffuse scattering, dB (10 log mu, APL-UW TR 9407).
    mirror: share of the reflected intensity that is reflected as by a mirror, 0 to 1.
    colour: red, green, blue, alpha, 0 to 1, for pictures.
    """

    name: str
    reflection: float
    slope: float
    lambert_db: float
    mirror: float
    colour: Colour = (0.6, 0.6, 0.6, 1.0)


# Reflections from impedances in MRayl (water 1.5): concrete 8, steel 45, granite 13, quartz sand 3.5, mud 1.8, oak 3,
# PVC 3.3, glass fibre 4.5, rubber 1.8. Lambert's strengths of sediments and rock after APL-UW TR 9407.
_ALL = (
    Material("concrete", 0.68, 0.30, -12.0, 0.5, (0.62, 0.62, 0.60, 1.0)),
    Material("steel", 0.93, 0.15, -20.0, 0.8, (0.45, 0.50, 0.56, 1.0)),
    Material("rock", 0.79, 0.50, -10.0, 0, (0.45, 0.42, 0.38, 1.0)),
    Material("gravel", 0.50, 0.40, -17.0, 0, (0.55, 0.52, 0.45, 1.0)),
    Material("sand", 0.40, 0.25, -22.0, 0.1, (0.80, 0.72, 0.50, 1.0)),
    Material("mud", 0.10, 0.25, -27.0, 0.1, (0.40, 0.33, 0.25, 1.0)),
    Material("wood", 0.33, 0.30, -16.0, 0.3, (0.55, 0.38, 0.20, 1.0)),
    Material("plastic", 0.38, 0.15, -18.0, 0.8, (0.95, 0.55, 0.10, 1.0)),
    Material("fibreglass", 0.50, 0.15, -18.0, 0.8, (0.55, 0.70, 0.80, 1.0)),
    Material("rubber", 0.09, 0.20, -20.0, 0.5, (0.15, 0.15, 0.15, 1.0)),
)
MATERIALS: Dict[str, Material] = {material.name: material for material in _ALL}
DEFAULT_MATERIAL = MATERIALS["concrete"]


def material_of_reflection(reflection: float) -> Material:
    """Return a material that reflects this share of the pressure, 0 to 1, and is otherwise the default."""
    like = DEFAULT_MATERIAL
    return Material(f"reflection {reflection:g}", reflection, like.slope, like.lambert_db, like.mirror, like.colour)

"""Depth from water pressure."""

STANDARD_GRAVITY = 9.80665  # m/s^2


def depth_of_pressure(pressure: float, surface_pressure: float, density: float) -> float:
    """Return the depth [m] below the surface where the water's absolute pressure is `pressure` [Pa].

    density: of the water, kg/m^3, taken to be the same at all depths.
    """
    return (pressure - surface_pressure) / (density * STANDARD_GRAVITY)

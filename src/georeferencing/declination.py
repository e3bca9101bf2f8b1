"""Where a compass points: the World Magnetic Model, with the coefficients that pygeomag carries (2010 to 2030)."""

from datetime import datetime, timezone

from node_support.errors import RefusedInput


def declination_deg(latitude_deg: float, longitude_deg: float, seconds: float) -> float:
    """Return how far magnetic north lies east of north at sea level, deg; `seconds`: since 1970.

    Raises RefusedInput for a time without coefficients, near a magnetic pole, and without pygeomag.
    """
    try:
        from pygeomag import GeoMag
    except ImportError:
        raise RefusedInput("origins refused", "needs pygeomag; install it with: pip install pygeomag") from None
    date = datetime.fromtimestamp(seconds, timezone.utc)
    year = date.year + (date.timetuple().tm_yday - 1) / 365.25
    try:
        field = GeoMag(base_year=date).calculate(latitude_deg, longitude_deg, 0.0, year, raise_in_warning_zone=True)
    except Exception as error:  # pygeomag has no common class for a wrong year and a compass that points down
        raise RefusedInput("origins refused", f"no declination in {date.year}: {error}") from error
    return float(field.d)

"""A run on the Earth: where its map lies, as the user or satellites tell; fixes of satellites, and files of charts."""

import sys
from argparse import Namespace
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, Dict, List, Sequence

import numpy as np

from georeferencing.adjustment import Adjusted, adjusted
from georeferencing.asked import AskedOrigin
from georeferencing.chart_files import ChartedPath, geojson, kml
from georeferencing.fixes import Fix, PlacedFixes, fix_of
from georeferencing.origin import STORED
from mlsm_manager.offline.bag_mapping import MappedBag
from mlsm_manager.offline.run_files import Run, positions_at
from mlsm_manager.surface_map.export.charts import write_geotiff, write_tiles
from mlsm_manager.surface_map.map_file import ExportError
from node_support.errors import RefusedInput
from node_support.files import write_whole
from node_support.topics import CHART_POSITION
from recordings.bags.bag import Bag, RecordingError
from recordings.makers_logs import is_makers_log
from recordings.motion.autopilot_log import fixes_of_autopilot, is_autopilot_log
from recordings.motion.motion_table import is_table
from recordings.ping_viewer_next import vehicle_fixes

_TYPE = "sensor_msgs/NavSatFix"


def satellite_fixes(path: Path) -> List[Fix]:
    """Return the fixes in a bag, those of the topic with most, or in a log; none in a file that holds no positions.

    Messages of receivers without a fix are left out. Raises RecordingError.
    """
    if is_autopilot_log(path):
        return fixes_of_autopilot(path)
    if is_makers_log(path):
        return vehicle_fixes(path)
    if is_table(path):
        return []
    fixes: List[Fix] = []
    with Bag(path) as bag:
        # What mlsm_core published is no measurement.
        topics = [one for one in bag.topics.values() if one.type == _TYPE and not one.name.endswith(CHART_POSITION)]
        for topic in sorted(topics, key=lambda one: -one.count)[:1]:
            for _, message in bag.messages(topic.name):
                with suppress(RefusedInput):
                    fixes.append(fix_of(message))
    return sorted(fixes)


CHART_FILES = ("path.geojson", "path.kml", "map.tif", "tiles")


def with_origin(mapped: MappedBag, options: Namespace) -> MappedBag:
    """Return what was mapped with a map that knows where it lies, where that was asked for. Raises RecordingError."""
    asked = options.origin
    if asked is None:
        return mapped
    try:
        if asked.place is None:
            files = [options.bags[0], *([options.vehicle] if options.vehicle else [])]
            found = origin_of_fixes(mapped.run, [fix for file in files for fix in satellite_fixes(file)], asked)
        else:
            found = Adjusted(asked.origin(float(mapped.run.times[0])))
    except RefusedInput as refused:
        raise RecordingError(f"--origin: {refused}") from refused
    stored = replace(mapped.run.stored, arrays={**mapped.run.stored.arrays, STORED: found.origin.array})
    counts = {**mapped.run.counts, "origin": _to_mapping(found)}
    return replace(mapped, run=replace(mapped.run, stored=stored, counts=counts), charted=found)


def origin_of_fixes(run: Run, fixes: Sequence[Fix], asked: AskedOrigin) -> Adjusted:
    """Return where fixes put the map of a run. Raises RefusedInput where none is of its time."""
    during = [fix for fix in fixes if run.times[0] <= fix.time <= run.times[-1]]
    if not during:
        raise RefusedInput("origins refused", f"{len(fixes)} fixes of satellites, none while the odometry is known")
    times = np.array([fix.time for fix in during])
    variances = np.zeros(len(times))
    if run.trust is not None:
        stated = np.trace(run.trust.covariances, axis1=1, axis2=2) / 2.0
        variances = np.interp(times, run.trust.times, stated)
    placed = PlacedFixes.of(during, positions_at(run.times, run.best, times), variances)
    return adjusted(placed, asked.before(placed))


def _to_mapping(found: Adjusted) -> Dict[str, Any]:
    origin = found.origin
    return {
        "latitude": round(origin.latitude_deg, 8),
        "longitude": round(origin.longitude_deg, 8),
        "azimuth": round(origin.azimuth_deg, 3),
        "deviation": round(float(np.sqrt(np.trace(origin.covariance[:2, :2]))), 3),
        "azimuth_deviation": round(float(np.degrees(np.sqrt(origin.covariance[2, 2]))), 3),
        "fixes": found.used,
        "outliers": found.outliers,
        "note": found.note,
    }


def write_charts(folder: Path, mapped: MappedBag) -> None:
    """Write the files of charts where it is known where the map lies; without rasterio the path only."""
    run, origin = mapped.run, mapped.run.stored.origin
    if origin is None:
        return
    path = ChartedPath(mapped.title, run.times, run.best)
    write_whole(folder / "path.geojson", geojson(origin, path, run.stored.marks))
    write_whole(folder / "path.kml", kml(origin, path, run.stored.marks))
    if not len(run.blocks):
        return
    try:
        write_geotiff(folder / "map.tif", run.blocks, origin)
        write_tiles(folder / "tiles", run.blocks, origin)
    except ExportError as error:
        print(f"map_bag: map.tif and tiles: {error}", file=sys.stderr)

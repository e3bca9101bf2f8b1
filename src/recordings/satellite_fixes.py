"""Fixes of satellites in recordings."""

from contextlib import suppress
from pathlib import Path
from typing import List

from georeferencing.fixes import Fix, fix_of
from node_support.errors import RefusedInput
from node_support.topics import CHART_POSITION
from recordings.bags.bag import Bag
from recordings.makers_logs import is_makers_log
from recordings.motion.autopilot_log import fixes_of_autopilot, is_autopilot_log
from recordings.motion.motion_table import is_table

_TYPE = "sensor_msgs/NavSatFix"


def satellite_fixes(path: Path) -> List[Fix]:
    """Return the fixes in a bag or in an autopilot's log, those of the topic with most; none in any other file.

    Messages of receivers without a fix are left out. Raises RecordingError.
    """
    if is_autopilot_log(path):
        return fixes_of_autopilot(path)
    if is_table(path) or is_makers_log(path):
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

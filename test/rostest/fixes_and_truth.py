"""What tests of a vehicle without a DVL share: whether its fixes follow the truth, as well as they say themselves."""

from typing import List, NamedTuple

import numpy as np
from geometry_msgs.msg import PoseWithCovarianceStamped
from graph import LONG_PATIENCE, Inbox, launched
from nav_msgs.msg import Odometry

_TOLD = 3.0  # told deviations within which an error is expected


class Followed(NamedTuple):
    """Of the fixes but the first, where both begin. errors: (n,) m. told: (n,) m, deviations. way: m, the true one."""

    errors: np.ndarray
    told: np.ndarray
    way: float

    @property
    def share_as_told(self) -> float:
        """Share of the fixes that are as near to the truth as they say."""
        return float(np.mean(self.errors <= _TOLD * self.told))


def followed(launch_file: str, arguments: List[str], count: int) -> Followed:
    """Run a launch file until `count` fixes have come and compare them with the truth."""
    truth = Inbox("/ground_truth", Odometry)
    fixes = Inbox("/MLSM/pose", PoseWithCovarianceStamped)
    with launched(launch_file, *arguments):
        found = fixes.wait_for_number(count, LONG_PATIENCE)[:count]
        truth.wait_for(lambda message: message.header.stamp >= found[-1].header.stamp)
    stamps, true = stamps_and_places(truth.messages)
    times, fixed = stamps_and_places(found)
    there = np.column_stack([np.interp(times, stamps, true[:, axis]) for axis in (0, 1)])
    errors = np.hypot(*((fixed - fixed[0]) - (there - there[0])).T)[1:]
    variances = np.array([fix.pose.covariance[0] + fix.pose.covariance[7] for fix in found])
    return Followed(errors, np.sqrt(variances[1:] + variances[0]), float(np.hypot(*(there[-1] - there[0]))))


def stamps_and_places(messages: list) -> tuple:
    """Return stamps (n,) s and positions (n, 2) m."""
    rows = [(m.header.stamp.to_sec(), m.pose.pose.position.x, m.pose.pose.position.y) for m in messages]
    values = np.array(rows)
    return values[:, 0], values[:, 1:]

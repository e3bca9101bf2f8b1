"""Beams of messages."""

from typing import Any

import numpy as np

from node_support.errors import RefusedInput
from node_support.headers import check_frame, check_stamp
from recordings.messages.poses import frame_name
from recordings.messages.stamps import stamp_ns
from sonar_processing.beams.beam import Beam


def beam_of(message: Any) -> Beam:
    """Return the beam of a SonarScanLine; raises RefusedInput for one that cannot be used."""
    if not message.maxrange_meters > 0.0:
        raise RefusedInput("beams refused", f"maxrange_meters {message.maxrange_meters}, must be above 0 m")
    frame, stamp = frame_name(message.header.frame_id), stamp_ns(message)
    check_frame(frame, "beams refused")
    check_stamp(stamp)
    return Beam(
        stamp_ns=stamp,
        frame_id=frame,
        angle=float(message.angle),
        intensities=np.asarray(message.intensities, dtype=np.uint8),
        range_resolution=float(message.range_resolution),
        sensor_angle=float(message.sensorAngle),
    )

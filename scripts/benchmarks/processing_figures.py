"""Messages, and the chain from beams to blocks."""

from io import BytesIO
from typing import List

import numpy as np

from benchmarks import processing_graph
from benchmarks.basin_messages import basin_messages
from benchmarks.map_figures import RESOLUTION, scan
from benchmarks.table import Row, median_seconds
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from sonar_processing.beams.beam import Beam
from sonar_processing.beams.placed_beam import PlacedBeam
from sonar_processing.cloud import IntensityCloud
from sonar_processing.filters.echo_extraction import EchoExtractorParameters, extract_echoes
from sonar_processing.filters.echo_extractor import EchoExtractor
from sonar_processing.filters.outliers import OutlierRemover, OutlierRemoverParameters
from sonar_processing.filters.threshold import Thresholder, ThresholderParameters
from sonar_processing.messages.parameters import BeamMessageParameters
from sonar_processing.messages.reader import BeamReader
from sonar_processing.messages.type_table import OWN
from sonar_processing.ros.conversions import (
    StampedIntensityCloudArrays,
    cloud_from_message,
    cloud_to_message,
)
from sonar_processing.scans.assembler import ScanAssembler
from sonar_processing.scans.parameters import SonarToCloudParameters
from sonar_processing.scans.polar_scan import PolarScan
from underwater_map_construction.msg import SonarScanLine


def message_rows() -> List[Row]:
    """Measure a 60,000-point cloud to bytes and back."""
    rng = np.random.default_rng(3)
    points = scan(rng, np.zeros(2), 60_000).astype(np.float32)
    cloud = IntensityCloud(points, rng.uniform(1, 2, len(points)), 10**9, "odom")
    buffer = BytesIO()

    def write() -> None:
        buffer.seek(0)
        cloud_to_message(cloud).serialize(buffer)

    write_seconds = median_seconds(write)
    data = buffer.getvalue()
    read_seconds = median_seconds(lambda: cloud_from_message(StampedIntensityCloudArrays().deserialize(data)))
    return [
        ("60,000 points to a serialised message", f"{1e3 * write_seconds:.2f} ms", ""),
        ("a serialised message to 60,000 points", f"{1e3 * read_seconds:.2f} ms", ""),
    ]


def _beam(message: SonarScanLine) -> Beam:
    return BeamReader(BeamMessageParameters()).read(OWN, message).beams[0]


def chain_rows() -> List[Row]:
    """Measure beams to inserted blocks on the recorded tour of the basin."""
    beams, poses = basin_messages()
    recorded = beams[-1].header.stamp.to_sec() - beams[0].header.stamp.to_sec()

    def run() -> None:
        assembler, surface_map = ScanAssembler(SonarToCloudParameters()), MultiLevelSurfaceMap(RESOLUTION)
        stages = [Thresholder(ThresholderParameters()), OutlierRemover(OutlierRemoverParameters())]
        for message in beams:
            beam = _beam(message)
            cloud = assembler.add(PlacedBeam(beam, poses[beam.stamp_ns], is_moving=False))
            if cloud is not None:
                for stage in stages:
                    cloud = stage(cloud)
                surface_map.insert(cloud.points)

    seconds = median_seconds(run, repeats=5)
    return [(f"beams to blocks, {len(beams)} beams of 500 bins", f"{recorded / seconds:.0f} times real time", ">= 50")]


def extraction_rows() -> List[Row]:
    """Measure the echo extractor on a turn of the recorded tour of the basin, as it comes to the stage."""
    beams = [_beam(message) for message in processing_graph.recorded_beams()]
    scan = PolarScan.of([PlacedBeam(beam, np.eye(4), is_moving=False) for beam in beams])
    parameters = SonarToCloudParameters()
    cloud, extractor = scan.cloud(parameters), EchoExtractor(EchoExtractorParameters())
    strengths, echoes = scan.strengths, len(extractor(cloud))
    core_seconds = median_seconds(lambda: extract_echoes(strengths, scan.range_resolution))
    stage_seconds = median_seconds(lambda: extractor(cloud))
    polar_seconds = median_seconds(lambda: scan.cloud(parameters))
    return [
        (f"{echoes} echoes of {strengths.size} bins", f"{1e3 * core_seconds:.2f} ms", "about 2 ms"),
        ("the same as a stage, from cloud to cloud", f"{1e3 * stage_seconds:.2f} ms", ""),
        (f"polar scan of {len(beams)} beams to an organised cloud", f"{1e3 * polar_seconds:.2f} ms", ""),
    ]


def rows() -> List[Row]:
    """Return the figures of the processing chain."""
    return message_rows() + chain_rows() + extraction_rows() + processing_graph.rows()

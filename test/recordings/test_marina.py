"""map_bag on the recorded marina: the figures that the position fix must keep, from the recording alone."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from benchmarks.fault_makers import range_told
from benchmarks.faults import shortened
from benchmarks.harness import mapped_as
from benchmarks.rare_faults import bottom_lost

from mlsm_manager.offline.recording import read_recording, scans_of
from mlsm_manager.offline.replay import ReplayParameters
from mlsm_manager.self_check.echo_causes import echo_findings
from mlsm_manager.self_check.scan_pairs import AS_TOLD
from recordings.reader import Request
from sonar_processing.filters.echo_extractor import EchoExtractor

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def marina(recording, tmp_path_factory):
    folder = tmp_path_factory.mktemp("marina")
    command = [sys.executable, str(ROOT / "nodes/map_bag"), str(recording("marina_first.bag")), "--out", str(folder)]
    subprocess.run([*command, "--truth", "/ground_truth", "--refine"], check=True, stdout=subprocess.DEVNULL)
    return json.loads((folder / "summary.json").read_text())


def test_the_position_known_at_each_moment_errs_by_less_than_1_6_m_in_the_mean_and_4_5_m_at_most(marina):
    assert marina["corrected"]["mean"] < 1.6
    assert marina["corrected"]["max"] < 4.5


def test_the_smoothed_way_errs_by_less_than_1_4_m_in_the_mean_and_3_5_m_at_most(marina):
    assert marina["refined"]["mean"] < 1.4
    assert marina["refined"]["max"] < 3.5


def test_the_odometry_alone_errs_by_more_than_6_m(marina):
    assert marina["dead_reckoning"]["mean"] > 6.0


def test_nearly_all_scans_are_matched(marina):
    assert marina["matched"] >= 0.9 * marina["scans"]


def test_a_range_setting_that_is_shortened_does_not_make_the_odometry_look_too_long(recording):
    whole = shortened(read_recording(recording("marina_first.bag"), Request()), 400.0)
    assert not mapped_as(range_told(whole, at=200.0, share=0.4), "--refine").findings.trust.causes


def test_a_lost_bottom_does_not_make_the_odometry_look_mirrored(recording):
    whole = shortened(read_recording(recording("marina_first.bag"), Request()), 330.0)
    lost = bottom_lost(whole, at=200.0, seconds=100.0, speed=0.2)
    scans = [scan for scan, _ in scans_of(lost, EchoExtractor(ReplayParameters().echoes()))]
    assert echo_findings(scans, lost.sonar_in_base).mount == AS_TOLD

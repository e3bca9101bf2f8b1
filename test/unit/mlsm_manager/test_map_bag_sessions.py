"""map_bag with several recordings of one place."""

from functools import partial

import numpy as np
import pytest
from map_bag_runs import BASIN, run, summary_of

from mlsm_manager.offline.recording import read_recording
from mlsm_manager.offline.replay_parameters import ReplayParameters
from mlsm_manager.offline.sessions import executor_for, prepared, prepared_in_parallel
from mlsm_manager.surface_map.map_file import read_map
from recordings.reader import Request

pytestmark = pytest.mark.long

# map_bag runs as a process of its own here, so that its import of a compiled module of ROS does not show.
pytest.importorskip("tf2_py")
TRAJECTORIES = ("trajectory.csv", "trajectory_2.csv")


@pytest.fixture(scope="module")
def twice(tmp_path_factory):
    """Return the folder of a run with the same recording twice."""
    folder = tmp_path_factory.mktemp("twice")
    done = run(BASIN, BASIN, "--out", folder)
    assert done.returncode == 0, done.stderr
    return folder


def test_a_second_recording_is_found_in_the_map_of_the_first_and_adds_to_it(twice):
    summary = summary_of(twice)
    (second,) = summary["sessions"]
    assert (second["found_after_scans"], second["matched"]) == (0, second["scans"])
    first, second = (np.loadtxt(str(twice / name), delimiter=",", skiprows=1) for name in TRAJECTORIES)
    assert np.hypot(*(first - second)[-20:, 4:6].T).max() < 0.5
    assert read_map(twice / "map.mlsm").shown.count.sum() > 1.8 * summary["scans"] * 50


def test_the_report_shows_the_way_of_each_recording(twice):
    pytest.importorskip("plotly")
    assert "corrected, basin.bag" in (twice / "report.html").read_text()


def test_a_dask_cluster_prepares_further_recordings():
    distributed = pytest.importorskip("distributed")
    read = partial(read_recording, request=Request())
    # The worker is a thread here, but is spoken to over TCP, as any other.
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, protocol="tcp", dashboard_address=None, host="127.0.0.1"
    ) as cluster, executor_for(2, cluster.scheduler_address) as executor:
        ((there, scans),) = prepared_in_parallel([BASIN], read, ReplayParameters(), executor)
    here, expected = prepared(BASIN, read, ReplayParameters())
    assert len(there.beams) == len(here.beams)
    assert [scan.points.tobytes() for scan in scans] == [scan.points.tobytes() for scan in expected]

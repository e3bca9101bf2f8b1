"""Many recordings are mapped by themselves; a bad one costs no other, and what is there stays."""

import shutil
import time
from pathlib import Path

import pytest
from programs import ROOT

from mlsm_manager.offline.each import INDEX, Cluster, map_each, options_of_one, recordings_in
from mlsm_manager.offline.index_page import Outcome
from mlsm_manager.self_check.verdict import RunAnswer
from recordings.bags.bag import RecordingError


def test_recordings_are_found_in_folders_and_nothing_else_is(tmp_path):
    for name in ("one/b.bag", "one/a.MCAP", "one/notes.txt", "one/deep/x.852", "one/deep/firmware.bin"):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"-")
    (tmp_path / "ros2").mkdir()
    for name in ("metadata.yaml", "ros2_0.db3"):
        (tmp_path / "ros2" / name).write_bytes(b"-")
    found = recordings_in([tmp_path, tmp_path / "named.xyz", tmp_path / "one" / "b.bag"])
    names = [one.relative_to(tmp_path).as_posix() for one in found]
    assert names == ["one/a.MCAP", "one/b.bag", "one/deep/x.852", "ros2", "named.xyz"]


def test_folders_without_a_recording_are_refused(tmp_path):
    with pytest.raises(RecordingError, match="no recording in"):
        recordings_in([tmp_path])


def test_every_recording_is_mapped_with_the_other_options():
    words = ["--each", "a.bag", "--scheduler", "tcp://a:1", "./b.bag", "--out", "maps"]
    words += ["--refine", "--set", "min_range=1", "--out=maps"]
    assert options_of_one(words, [Path("a.bag"), Path("b.bag")]) == ["--refine", "--set", "min_range=1"]


@pytest.fixture
def cluster():
    """A scheduler with a worker, a thread here that is spoken to over TCP as any other."""
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=2, processes=False, protocol="tcp", dashboard_address=None, host="127.0.0.1"
    ) as running:
        yield running


@pytest.mark.long
@pytest.mark.parametrize("is_shared", [False, True])
def test_a_bad_recording_costs_no_other_and_a_map_that_is_there_stays(tmp_path, capsys, request, is_shared):
    scheduler = request.getfixturevalue("cluster").scheduler_address if is_shared else None
    good, same, bad = ROOT / "test/data/basin.bag", tmp_path / "basin.bag", tmp_path / "basin_2.bag"
    shutil.copy(good, same)
    bad.write_bytes(b"no bag")
    out, recordings = tmp_path / "maps", [good, bad] if is_shared else [good, bad, same]
    first = map_each(recordings, out, [], scheduler)
    assert [bool(outcome.summary) for outcome in first] == [one is not bad for one in recordings]
    assert "not a bag, or damaged" in first[1].problem
    assert is_shared or first[0].summary["scans"] == first[2].summary["scans"]
    assert is_shared or (out / "basin_3/map.ply").is_file()
    page, mapped = (out / INDEX).read_text(), len(recordings) - 1
    assert page.count("<img") == mapped
    assert f"{mapped} of {len(recordings)} recordings mapped" in page
    assert "not a bag, or damaged" in page
    written = (out / "basin/summary.json").stat().st_mtime_ns
    again = map_each(recordings, out, [], scheduler)
    assert again == first
    assert (out / "basin/summary.json").stat().st_mtime_ns == written
    assert f"{len(recordings)}/{len(recordings)}" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("summary", "answer"),
    [
        ({}, "no map"),
        ({"scans": 4}, "not measured"),  # nothing was checked
        *(({"answer": one.value}, one.value) for one in RunAnswer),
    ],
)
def test_the_page_says_of_each_recording_what_its_own_summary_says(summary, answer):
    assert Outcome(Path("a.bag"), Path("a"), summary, "").answer == answer


def test_a_cluster_that_is_not_there_is_told_before_the_first_map(tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("mlsm_manager.offline.each.TIMEOUT", 0.5)
    with pytest.raises(RecordingError, match=r"--scheduler tcp://127\.0\.0\.1:9: "):
        map_each([ROOT / "test/data/basin.bag"], tmp_path / "maps", [], "tcp://127.0.0.1:9")
    assert not list((tmp_path / "maps").iterdir())


def test_a_folder_that_a_worker_does_not_see_is_told(tmp_path, cluster):
    with pytest.raises(RecordingError, match="does not see"):
        Cluster(cluster.scheduler_address, tmp_path / "nowhere")


def test_a_cluster_without_workers_ends_in_one_line_and_says_what_stays(tmp_path, cluster, monkeypatch):
    monkeypatch.setattr("mlsm_manager.offline.each.PATIENCE", 0.0)
    with Cluster(cluster.scheduler_address, tmp_path) as workers:
        workers.check("all stays")
        cluster.scale(0)
        assert_told_within_a_minute(workers, "all workers are lost")


@pytest.mark.long
def test_a_lost_scheduler_ends_in_one_line_and_says_what_stays(tmp_path, cluster):
    with Cluster(cluster.scheduler_address, tmp_path) as workers:
        cluster.close()
        assert_told_within_a_minute(workers, "the scheduler is lost")


def assert_told_within_a_minute(workers, lost):
    with pytest.raises(RecordingError, match=f"{lost}; 3 of 5 stay, and the same command goes on"):
        check_for_a_minute(workers)


def check_for_a_minute(workers):
    for _ in range(600):
        workers.check("3 of 5 stay")
        time.sleep(0.1)

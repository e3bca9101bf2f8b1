"""Logs as operators have them, mapped without options: sectors, ranges that change, few sweeps, any language."""

import json

import numpy as np
import pytest
from made_recordings import ranges_along
from test_recordings_ping_viewer import PERSIAN, clock, log_bytes, text_bytes
from test_sweep_shifts import WALLS

from mlsm_manager.offline.map_bag import map_bag, map_bag_arguments
from mlsm_manager.surface_map.map_file import read_map
from ping360_driver.messages import MessageId, packed

TICK, HALF_SOUND = 25e-9, 750.0  # s, m/s
SAMPLES = 400


def sent(gradians, reach, gain, generator, is_silent=False):
    """Return what a Ping360 sends of the room in one direction."""
    length = reach / SAMPLES
    strengths = generator.exponential(4.0, SAMPLES) * (not is_silent)
    (distance,) = ranges_along(np.zeros((1, 2)), np.array([(200 - gradians) * np.pi / 200.0]), WALLS)
    first = int(distance / length)
    strengths[first : first + max(round(0.3 / length), 2)] += 120.0 * (not is_silent)
    data = np.minimum(strengths, 255.0).astype(np.uint8).tobytes()
    return packed(
        MessageId.DEVICE_DATA, mode=1, gain_setting=gain, angle=int(gradians) % 400, transmit_duration=32,
        sample_period=round(length / HALF_SOUND / TICK), transmit_frequency=750, number_of_samples=SAMPLES,
        data_length=SAMPLES, data=data,
    )  # fmt: skip


def written(path, parts, pause=0.0, is_silent=False):
    """Write a log, in Persian, of (gradians, range [m], gain) ten times a second, with a pause [s] in the middle."""
    generator = np.random.default_rng(3)
    seconds = (1.0 + 0.1 * index + pause * (2 * index >= len(parts)) for index in range(len(parts)))
    times = (text_bytes(clock(one).translate(PERSIAN)) for one in seconds)
    messages = (sent(*part, generator, is_silent) for part in parts)
    body = b"".join(time + len(data).to_bytes(4, "big") + data for time, data in zip(times, messages))
    path.write_bytes(log_bytes([]) + body)
    return path


def mapped(path, tmp_path):
    """Return the map's places (n, 2) and the summary."""
    map_bag(map_bag_arguments([str(path), "--out", str(tmp_path / "out")]))
    assert (tmp_path / "out/map.png").is_file()
    summary = json.loads((tmp_path / "out/summary.json").read_text())
    return read_map(tmp_path / "out/map.mlsm").shown.mean[:, :2], summary


def shares_on_walls(places, directions):
    """Return which share of the walls in `directions` [gradians] have a block within 0.4 m, and of blocks a wall."""
    angles = (200.0 - np.arange(400)) * np.pi / 200.0
    ranges = ranges_along(np.zeros((1, 2)), angles, WALLS)
    walls = ranges[:, np.newaxis] * np.column_stack([np.cos(angles), np.sin(angles)])
    apart = np.hypot(*(places[:, np.newaxis] - walls).transpose(2, 0, 1)) < 0.4
    return apart[:, directions].any(axis=0).mean(), apart.any(axis=1).mean()


def test_a_range_that_changes_within_a_sweep_costs_no_part_of_the_map(tmp_path):
    """A turn in four parts, of other range, gain and step each; nothing is heard twice."""
    directions = [*range(0, 100, 2), *range(100, 200), *range(200, 300, 5), *range(300, 400, 2)]
    settings = ([(12.0, 0)] * 50) + ([(30.0, 2)] * 100) + ([(15.0, 1)] * 20) + ([(50.0, 2)] * 50)
    path = written(tmp_path / "log.bin", [(one, *setting) for one, setting in zip(directions, settings)])
    places, summary = mapped(path, tmp_path)
    heard, true = shares_on_walls(places, directions)
    assert summary["scans"] == 4
    assert heard > 0.9
    assert true > 0.9


@pytest.mark.parametrize(("width", "sweeps"), [(34, 1), (100, 2), (100, 8), (334, 3)])
def test_sectors_to_and_fro_give_a_map_and_nothing_that_was_not_measured_is_fine(tmp_path, width, sweeps):
    forth = list(range(200 - width // 2, 201 + width // 2, 2))
    directions = [one for number in range(sweeps) for one in (forth, forth[::-1])[number % 2]]
    path = written(tmp_path / "log.bin", [(one, 15.0, 1) for one in directions])
    places, summary = mapped(path, tmp_path)
    heard, true = shares_on_walls(places, forth)
    assert summary["scans"] == sweeps
    assert heard > 0.9
    assert true > 0.9
    assert summary["odometry"]["profile"] in ("standing", "not told, held still")
    if summary["odometry"]["profile"] != "standing" or sweeps < 4:
        assert "NOT MEASURED" in summary["trust"]
        assert summary["deviation_per_minute"] == [None]


def test_sweeps_without_an_echo_and_a_pause_give_an_empty_map_that_says_so(tmp_path, capsys):
    path = written(tmp_path / "log.bin", [(one, 15.0, 1) for one in range(100, 180)], pause=300.0, is_silent=True)
    places, summary = mapped(path, tmp_path)
    assert (len(places), summary["scans"], summary["left_out"]) == (0, 2, {})
    assert "the map is empty" in capsys.readouterr().err

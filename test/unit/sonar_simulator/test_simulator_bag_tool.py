import math
import sys

import numpy as np
import pytest
import rosbag
import yaml

from sonar_simulator.simulation.scripted_vehicle import load_script
from sonar_simulator.simulation.simulate_bag import run_simulate_bag

SCRIPT = "moves: [{wait: 1}, {x: 2, y: 1, yaw_deg: 40, seconds: 4}, {tilt_deg: 20}, {wait: 1}]"
QUICK = ["--set", "sonar.ray_rows=5", "--set", "sonar.ray_columns=2", "--quiet"]


@pytest.fixture
def script(tmp_path):
    path = tmp_path / "script.yaml"
    path.write_text(SCRIPT)
    return path


def _write(tmp_path, script, name="out.bag", *arguments):
    out = tmp_path / name
    run_simulate_bag(["--world", "basin", "--script", str(script), "--out", str(out), *QUICK, *arguments])
    return out


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    """Return the bag of the script."""
    folder = tmp_path_factory.mktemp("bag")
    (folder / "script.yaml").write_text(SCRIPT)
    return _write(folder, folder / "script.yaml", "out.bag", "--set", "odometry.scale_error=0.25", "seed=9")


def _messages(path, topic):
    with rosbag.Bag(str(path)) as bag:
        return [(message, stamp) for _, message, stamp in bag.read_messages([topic])]


def test_a_bag_holds_beams_tf_odometry_and_truth(bag):
    with rosbag.Bag(str(bag)) as opened:
        counts = {topic: info.message_count for topic, info in opened.get_type_and_topic_info()[1].items()}
    assert counts["/sonar/raw"] == 46
    assert counts["/odom"] == counts["/ground_truth"] == counts["/cmd_vel"] == 121
    assert counts["/tf"] == counts["/joint_states"] == 121 + 46 - 16
    assert counts["/tf_static"] == 1


def test_the_same_seed_gives_the_same_bytes_and_another_seed_others(tmp_path, script):
    bags = [
        _write(tmp_path, script, name, "--set", f"seed={seed}")
        for name, seed in (("a.bag", 5), ("b.bag", 5), ("c.bag", 6))
    ]
    first, second, third = (bag.read_bytes() for bag in bags)
    assert first == second
    assert first != third


@pytest.mark.parametrize(("instruments", "begin"), [("DVL", (1.0, -2.0)), ("COMPASS", (0.0, 0.0))])
def test_the_map_of_a_vehicle_that_knows_no_position_begins_where_it_starts(tmp_path, script, instruments, begin):
    script.write_text("start: {x: 1.0, y: -2.0, z: -1.5}\nmoves: [{wait: 1.0}]\n")
    out = _write(tmp_path, script, "at.bag", "--set", f"instruments={instruments}")
    position = _messages(out, "/ground_truth")[0][0].pose.pose.position
    assert (position.x, position.y, position.z) == pytest.approx((*begin, -1.5))


def test_without_instruments_the_odometry_stays_where_the_vehicle_starts(tmp_path, script):
    script.write_text("start: {x: 1.0, y: -2.0, z: -1.5, yaw_deg: 90.0}\nmoves: [{x: 2.0, yaw_deg: 40.0}]\n")
    out = _write(tmp_path, script, "still.bag", "--set", "instruments=NONE")
    placed = [message.transforms[0] for message, _ in _messages(out, "/tf") if len(message.transforms) > 1]
    shifts = [(place.transform.translation.x, place.transform.translation.y) for place in placed]
    assert {place.child_frame_id for place in placed} == {"base_link"}
    assert set(shifts) == {(0.0, 0.0)}
    turns = np.array([place.transform.rotation.z for place in placed])
    np.testing.assert_allclose(turns, math.sqrt(0.5))
    assert not _messages(out, "/cmd_vel")


def test_every_beam_can_be_placed_at_its_own_stamp(bag):
    placed = {
        message.transforms[0].header.stamp: {transform.child_frame_id for transform in message.transforms}
        for message, _ in _messages(bag, "/tf")
    }
    for beam, stamp in _messages(bag, "/sonar/raw"):
        assert beam.header.stamp == stamp
        assert placed[stamp] == {"base_link", "sonar"}


def test_the_truth_is_the_script_and_the_odometry_errs_as_asked(bag, script):
    last = [_messages(bag, topic)[-1][0].pose.pose.position for topic in ("/ground_truth", "/odom")]
    end = load_script(script).pose(6.0)[:2, 3]
    np.testing.assert_allclose([(p.x, p.y) for p in last], [end, end / 1.25], atol=1e-9)


def test_the_servo_is_in_the_beams_the_joint_and_the_transform(bag):
    beam, joint = _messages(bag, "/sonar/raw")[-1][0], _messages(bag, "/joint_states")[-1][0]
    mount = _messages(bag, "/tf")[-1][0].transforms[1]
    assert joint.name == ["sonar_servo_joint"]
    assert joint.position[0] == pytest.approx(np.radians(20.0))
    assert beam.sensorAngle == pytest.approx(np.radians(20.0))
    assert 2.0 * np.arcsin(mount.transform.rotation.y) == pytest.approx(np.radians(20.0))


def test_a_bag_tells_how_it_was_made_and_nothing_of_the_machine(bag):
    told = yaml.safe_load(_messages(bag, "/sonar_simulator/settings")[0][0].data)
    found = told["world"], told["script"], told["seed"], told["sonar"]["ray_rows"]
    assert found == ("basin.sdf", "script.yaml", 9, 5)
    assert str(bag.parent).encode() not in bag.read_bytes()


def test_parameters_come_from_a_file_and_set_overrides_them(tmp_path, script):
    path = tmp_path / "parameters.yaml"
    path.write_text("seed: 3\nlaser_cone: {bins: 100, max_range: 25.0}")
    out = _write(tmp_path, script, "out.bag", "--parameters", str(path), "--set", "laser_cone.bins=50")
    beam = _messages(out, "/sonar/raw")[0][0]
    assert (len(beam.intensities), beam.maxrange_meters) == (50, 25.0)


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["--set", "odometry.scale_eror=1"], "odometry: scale_eror = 1: no such parameter"),
        (["--set", "seed"], "--set seed: must be KEY=VALUE"),
        (["--set", "drive=CMD_VEL"], "drive = 'CMD_VEL': nobody sends commands while a bag is written"),
        (["--world", "none.sdf"], "--world none.sdf: must be basin, harbour, tank, or a file that exists"),
        (["--robot", "none.urdf"], "none.urdf: No such file or directory"),
        (["--parameters", "none.yaml"], "none.yaml: No such file or directory"),
    ],
)
def test_what_is_wrong_is_one_line_and_nothing_is_written(tmp_path, script, arguments, line):
    with pytest.raises(SystemExit) as ended:
        _write(tmp_path, script, "out.bag", *arguments)
    assert line in ended.value.code
    assert "\n" not in ended.value.code
    assert not (tmp_path / "out.bag").exists()


def test_without_the_ray_caster_one_line_says_what_to_install(tmp_path, script, monkeypatch):
    monkeypatch.setitem(sys.modules, "embreex.rtcore_scene", None)
    with pytest.raises(SystemExit, match=r"^simulate_bag: .*-m pip install embreex$"):
        _write(tmp_path, script)
    assert not (tmp_path / "out.bag").exists()


def test_a_bag_that_could_not_be_finished_leaves_the_older_one(tmp_path, script, monkeypatch):
    out = _write(tmp_path, script)
    before = out.read_bytes()

    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("sonar_simulator.simulation.simulate_bag.SimulatedBag.add", stop)
    with pytest.raises(SystemExit, match="interrupted"):
        _write(tmp_path, script, "out.bag", "--overwrite")
    assert out.read_bytes() == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.bag", "script.yaml"]

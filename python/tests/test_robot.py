# SPDX-License-Identifier: Apache-2.0
"""Answers and drives for robots' tools: what the files hold is read back by other libraries."""

import json
import math
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import blindcorner as bc
from blindcorner import robot
from blindcorner.robot.__main__ import main


@pytest.fixture(scope="module")
def run():
    """A drive of a second or so; the oracle's answers cost nothing."""
    return bc.drive(bc.bundled("robot_drive.json"), perception="oracle", seed=1)


@pytest.fixture(scope="module")
def driven(run):
    return robot.of_run(run)


@pytest.fixture(scope="module")
def drive_json(run, tmp_path_factory):
    path = tmp_path_factory.mktemp("drive") / "drive.json"
    path.write_text(json.dumps(run.to_dict()))
    return path


def live_text(result, scene, times):
    """What ``blindcorner live`` prints: a head, then an answer for each time."""
    head = {"format": "blindcorner.live/1", "scene": scene.path, "unknowns": scene.unknowns}
    entry = result.to_dict()["captures"][0]
    answers = [{**entry, "time_s": t, "frame": i, "skipped": 0, "latency_ms": 5.0}
               for i, t in enumerate(times)]
    return "".join(json.dumps(line) + "\n" for line in [head, *answers])


# --- Without any other library ----------------------------------------------------------------------


def test_a_run_and_its_file_tell_the_same(driven, drive_json):
    setting, moments = driven
    again, read = robot.of_drive_document(robot.read_document(drive_json), str(drive_json))
    assert again.grid == setting.grid and len(read) == len(moments)
    for ours, theirs in zip(moments, read):
        assert (ours.time_s, ours.presence, ours.vehicle.x_m) == (
            theirs.time_s, theirs.presence, theirs.vehicle.x_m)
        np.testing.assert_array_equal(ours.path, theirs.path)
    # The map and the histograms are the simulation's alone.
    assert moments[0].occupancy.shape == (setting.grid.rows, setting.grid.columns)
    assert moments[0].counts.shape == (9, 128) and read[0].counts is None


def test_ninety_five_per_cent_ellipses_hold_that_share(scene, result):
    mode = robot.hypotheses(result.to_dict()["captures"][0]["modes"])[0]
    (found,) = robot.estimates(scene, mode)
    assert (found.position[:2] == mode.pose[:2]).all() and found.yaw_rad == mode.pose[3]
    # x, y, z and yaw; objects stand upright.
    np.testing.assert_array_equal(found.covariance[[0, 1, 2, 5]][:, [0, 1, 2, 5]], mode.covariance)
    assert not found.covariance[3:5].any() and not found.covariance[:, 3:5].any()
    major, minor, angle = found.ellipse()
    drawn = np.random.default_rng(1).multivariate_normal(mode.pose, mode.covariance, 20000)
    away = drawn[:, :2] - found.position[:2]
    turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    share = (((away @ turn.T) / [major, minor]) ** 2).sum(axis=1) < 1
    # Three standard deviations of a share of 20,000.
    assert abs(share.mean() - 0.95) < 3 * math.sqrt(0.95 * 0.05 / 20000)
    corners = found.ellipse_points() - found.position[:2]
    np.testing.assert_allclose((((corners @ turn.T) / [major, minor]) ** 2).sum(axis=1), 1)


def test_objects_are_told_apart():
    scene = bc.Scene.load(bc.bundled("street_two.json"))
    n = len(scene.unknowns)
    covariance = np.diag(np.arange(1.0, n + 1))
    mode = robot.Hypothesis(1.0, scene.bounds.mean(axis=1), covariance)
    first, second = robot.estimates(scene, mode)
    assert [first.name, second.name] == scene.objects
    for found in (first, second):
        for axis, component in enumerate(("x_m", "y_m")):
            i = scene.unknowns.index(f"{found.name}.{component}")
            assert found.position[axis] == mode.pose[i] and found.covariance[axis, axis] == i + 1
    # An explanation without the second object.
    gone = np.array([name.startswith(second.name) for name in scene.unknowns])
    mode = robot.Hypothesis(1.0, np.where(gone, np.nan, mode.pose), covariance)
    assert [found.name for found in robot.estimates(scene, mode)] == [first.name]


def test_cells_are_occupied_where_the_answer_is(scene, result):
    setting = robot.Setting(scene, cell_m=0.02)
    moment = robot.of_answer(result.to_dict()["captures"][0], 0.0)
    cells = setting.occupancy(moment)
    row, column = np.unravel_index(np.argmax(cells), cells.shape)
    place = np.array([setting.grid.x_m, setting.grid.y_m]) + 0.02 * np.array([column + 0.5, row + 0.5])
    (found,) = robot.estimates(scene, moment.modes[0])
    # The likeliest cell lies in the body of the heaviest mode, within its reach.
    reach = np.linalg.norm(found.footprint - found.position[:2], axis=1).max()
    assert np.linalg.norm(place - found.position[:2]) < reach
    assert 0.1 < cells.max() <= 1 and cells.min() >= 0
    # Half as probable an object makes each cell half as probable.
    half = robot.Moment(0.0, 0.5 * moment.presence, moment.modes)
    np.testing.assert_allclose(setting.occupancy(half), 0.5 * cells, atol=1e-12)
    assert setting.occupancy(robot.Moment(0.0)) is None


def test_grids_hold_bodies_however_they_are_turned():
    scene = bc.Scene.load(bc.bundled("street_turn.json"))
    grid = robot.Grid.around(scene)
    lower, upper = scene.bounds.T
    for yaw in np.linspace(lower[2], upper[2], 9):
        for x, y in [(lower[0], lower[1]), (upper[0], upper[1])]:
            (found,) = robot.estimates(scene, robot.Hypothesis(1, np.array([x, y, yaw]), np.eye(3)))
            cells = (found.footprint - [grid.x_m, grid.y_m]) / grid.cell_m
            assert (cells >= 0).all() and (cells <= [grid.columns, grid.rows]).all()


def test_names_become_topics():
    naming = robot.Naming(prefix="front/corner")
    assert naming.topic("blue plate", "pose") == "/front/corner/blue_plate/pose"
    assert naming.topic("2nd", "pose") == "/front/corner/_2nd/pose"


def test_zones_end_on_the_wall():
    scene = bc.Scene.load(bc.bundled("tmf8828_wall.json"))
    points = robot.zone_points(scene, scene.sensor_pose)
    fields = scene.to_dict()
    wall = next(s for s in fields["surfaces"] if s.get("relay"))
    normal = np.array(wall["normal"], dtype=float)
    distance = (points - np.array(wall["center_m"])) @ (normal / np.linalg.norm(normal))
    np.testing.assert_allclose(distance, 0, atol=1e-9)
    scan = robot.zone_scan(scene, scene.sensor_pose, np.ones((9, 128)))
    middle = np.linalg.norm(points[3:6] - scene.sensor_pose[:3, 3], axis=1)
    # Rays go from right to left, zones from left to right.
    np.testing.assert_allclose(scan.ranges, middle[::-1])
    np.testing.assert_array_equal(scan.intensities, 128)
    assert scan.first_rad < 0 < scan.step_rad


def test_lines_that_are_no_answers_are_counted(scene, result):
    lines = live_text(result, scene, [0.0, 0.1]).splitlines()
    short = json.loads(lines[1])
    short["modes"][0]["pose"].pop()
    wrong = {**json.loads(lines[1]), "presence_probability": 2}
    answers = robot.LiveAnswers([*lines[:2], "{cut", '{"time_s": 1}', json.dumps(short),
                                 json.dumps(wrong), "7", lines[2]])
    assert [m.time_s for m in answers] == [0.0, 0.1]
    assert answers.bad_lines == 5 and "line 3" in answers.first_bad
    with pytest.raises(bc.Error, match="line 1: format: found {, accepted"):
        robot.LiveAnswers(["{"])
    with pytest.raises(bc.Error, match="line 1: format: found nothing"):
        robot.LiveAnswers([])
    head = json.loads(lines[0])
    with pytest.raises(bc.Error, match="unknowns: found q_m, accepted: those of .*x_m"):
        robot.LiveAnswers([json.dumps({**head, "unknowns": ["q_m"]})])


@pytest.mark.parametrize("arguments, message", [
    (["drive", "none.json", "--serve"], "none.json: No such file"),
    (["drive", "DRIVE"], "found nothing to write, accepted: --foxglove, --ros2, --serve, --commonroad"),
    (["drive", "OTHER", "--foxglove", "a.mcap"], 'format: found "x/1", accepted: "blindcorner.drive/1"'),
    (["drive", "UNKNOWN", "--foxglove", "a.mcap"], "drive: found .mine., accepted: a bundled drive"),
    (["drive", "DRIVE", "--foxglove", "a.mcap", "--prefix", "a b"], 'prefix: found "a b"'),
    (["drive", "DRIVE", "--foxglove", "a.mcap", "--least-presence", "2"], "least_presence: found 2.0"),
    (["result", "DRIVE", "--serve"], 'format: accepted: "blindcorner.result/1"'),
    (["live", "none.jsonl", "--serve"], "none.jsonl: No such file"),
    (["live", "--serve", "--", "no_such_program"], "no_such_program: No such file"),
])
def test_what_is_wrong_is_told_in_one_line(arguments, message, drive_json, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    document = json.loads(drive_json.read_text())
    (tmp_path / "OTHER").write_text(json.dumps({**document, "format": "x/1"}))
    (tmp_path / "UNKNOWN").write_text(json.dumps({**document, "drive": "mine"}))
    (tmp_path / "DRIVE").write_text(json.dumps(document))
    assert main(arguments) == 2
    told = capfd.readouterr().err.strip()
    assert told.count("\n") == 0
    assert re.search(message, told), told
    assert sorted(p.name for p in tmp_path.iterdir()) == ["DRIVE", "OTHER", "UNKNOWN"]


@pytest.mark.parametrize("library, package, option", [
    ("foxglove", "foxglove-sdk", "--foxglove"), ("rosbags.interfaces", "rosbags", "--ros2"),
    ("commonroad.common.file_writer", "commonroad-io", "--commonroad")])
def test_a_missing_library_is_named(library, package, option, drive_json, tmp_path, monkeypatch, capfd):
    monkeypatch.setitem(sys.modules, library, None)
    assert main(["drive", str(drive_json), option, str(tmp_path / "out")]) == 2
    assert capfd.readouterr().err == (
        f'blindcorner: {package} is not installed, accepted: pip install "blindcorner[robot]"\n')
    assert not list(tmp_path.iterdir())


# --- ROS 2: rosbags writes, mcap and mcap-ros2-support read -----------------------------------------


@pytest.fixture(scope="module")
def bag(run, driven, tmp_path_factory):
    """(topic, message, log time) of a bag, by a reader of other people."""
    pytest.importorskip("rosbags", reason="rosbags is not installed")
    reader = pytest.importorskip("mcap.reader", reason="mcap is not installed")
    decoder = pytest.importorskip("mcap_ros2.decoder", reason="mcap-ros2-support is not installed")
    folder = tmp_path_factory.mktemp("ros") / "bag"
    with robot.RosBag(folder, driven[0], robot.Naming(start_ns=100 * 10**9)) as out:
        for moment in driven[1]:
            out.add(moment)
    with open(folder / "bag.mcap", "rb") as file:
        made = reader.make_reader(file, decoder_factories=[decoder.DecoderFactory()])
        return [(schema.name, channel.topic, message, decoded)
                for schema, channel, message, decoded in made.iter_decoded_messages()]


def of_topic(messages, topic):
    return [(m.log_time, d) for _, t, m, d in messages if t == topic]


def test_a_bag_holds_messages_that_others_read(bag):
    assert {(t, k) for k, t, _, _ in bag} == {
        ("/tf", "tf2_msgs/msg/TFMessage"), ("/tf_static", "tf2_msgs/msg/TFMessage"),
        ("/blindcorner/sign/pose", "geometry_msgs/msg/PoseWithCovarianceStamped"),
        ("/blindcorner/presence", "std_msgs/msg/Float64"),
        ("/blindcorner/grid", "nav_msgs/msg/OccupancyGrid"),
        ("/blindcorner/answer", "std_msgs/msg/String"), ("/blindcorner/plan", "nav_msgs/msg/Path"),
        ("/blindcorner/zones", "sensor_msgs/msg/LaserScan"),
        ("/blindcorner/markers", "visualization_msgs/msg/MarkerArray"),
        ("/blindcorner/scene", "visualization_msgs/msg/MarkerArray")}


def test_poses_of_a_bag_are_those_of_the_drive(bag, driven):
    setting, moments = driven
    stated = [m for m in moments if m.presence is not None and m.presence >= 0.5 and m.modes]
    poses = of_topic(bag, "/blindcorner/sign/pose")
    assert len(poses) == len(stated) > 5
    for moment, (log_time, pose) in zip(stated, poses):
        assert pose.header.frame_id == "map"
        stamp = pose.header.stamp.sec * 10**9 + pose.header.stamp.nanosec
        assert stamp == log_time == round((100 + moment.time_s) * 1e9)
        at = pose.pose.pose.position
        assert (at.x, at.y, at.z) == (*moment.modes[0].pose, pytest.approx(0.15))
        covariance = np.reshape(pose.pose.covariance, (6, 6))
        np.testing.assert_array_equal(covariance[:2, :2], moment.modes[0].covariance)
        assert not covariance[2:].any()
        # The scene states the sign's yaw: -20 degrees.
        turn = pose.pose.pose.orientation
        assert 2 * math.atan2(turn.z, turn.w) == pytest.approx(math.radians(-20))


def test_grids_of_a_bag_are_those_of_the_drive(bag, driven):
    setting, moments = driven
    grids = of_topic(bag, "/blindcorner/grid")
    assert len(grids) == len(moments)
    for moment, (_, grid) in zip(moments, grids):
        assert (grid.info.width, grid.info.height) == (setting.grid.columns, setting.grid.rows)
        assert grid.info.resolution == pytest.approx(0.05)
        assert (grid.info.origin.position.x, grid.info.origin.position.y) == (-2.0, -1.2)
        cells = np.reshape(grid.data, moment.occupancy.shape)
        known = np.isfinite(moment.occupancy)
        assert (cells[~known] == -1).all() and (~known).any()
        np.testing.assert_allclose(cells[known], 100 * moment.occupancy[known], atol=0.5)


def test_transforms_lead_from_the_map_to_the_sensor(bag, driven):
    setting, moments = driven
    (_, mounted), = of_topic(bag, "/tf_static")
    (link,) = mounted.transforms
    assert (link.header.frame_id, link.child_frame_id) == ("base_link", "blindcorner_sensor")
    assert link.transform.translation.x == pytest.approx(0.1)
    assert 2 * math.atan2(link.transform.rotation.z, link.transform.rotation.w) == pytest.approx(
        math.radians(8.75))
    for moment, (_, message) in zip(moments, of_topic(bag, "/tf")):
        (link,) = message.transforms
        assert (link.header.frame_id, link.child_frame_id) == ("map", "base_link")
        assert link.transform.translation.x == moment.vehicle.x_m
        turn = link.transform.rotation
        assert math.remainder(2 * math.atan2(turn.z, turn.w) - moment.vehicle.yaw_rad,
                              2 * math.pi) == pytest.approx(0, abs=1e-9)


def test_plans_scans_and_markers_of_a_bag(bag, driven):
    setting, moments = driven
    for moment, (_, path) in zip(moments, of_topic(bag, "/blindcorner/plan")):
        points = [(p.pose.position.x, p.pose.position.y) for p in path.poses]
        np.testing.assert_array_equal(points, moment.path)
    for moment, (_, scan) in zip(moments, of_topic(bag, "/blindcorner/zones")):
        assert len(scan.ranges) == 3 and scan.header.frame_id == "blindcorner_sensor"
        if moment.counts is not None:
            np.testing.assert_allclose(sorted(scan.intensities),
                                       sorted(moment.counts[3:6].sum(axis=1)), rtol=1e-6)
    _, markers = of_topic(bag, "/blindcorner/markers")[-1]
    names = [m.ns for m in markers.markers]
    assert markers.markers[0].action == 3  # DELETEALL
    assert {"sign/0/ellipse95", "sign/0/body", "sign/0/text", "sign/truth", "vehicle"} <= set(names)
    ellipse = markers.markers[names.index("sign/0/ellipse95")]
    (found,) = robot.estimates(setting.scene, moments[-1].modes[0])
    np.testing.assert_allclose([(p.x, p.y) for p in ellipse.points[:-1]], found.ellipse_points())
    _, walls = of_topic(bag, "/blindcorner/scene")[0]
    assert [m.ns for m in walls.markers[1:]] == ["outer wall", "right wall", "floor", "inner corner"]


def test_a_bag_says_which_topics_last(bag, driven, tmp_path):
    from rosbags.highlevel import AnyReader
    from rosbags.interfaces import QosDurability

    with robot.RosBag(tmp_path / "bag", driven[0], storage="sqlite3") as out:
        out.add(driven[1][0])
    with AnyReader([tmp_path / "bag"]) as reader:
        lasting = {c.topic for c in reader.connections
                   if c.ext.offered_qos_profiles[0].durability == QosDurability.TRANSIENT_LOCAL}
    assert lasting == {"/tf_static", "/blindcorner/scene"}
    with pytest.raises(bc.Error, match="bag: is there already, accepted: a new directory"):
        robot.RosBag(tmp_path / "bag", driven[0])


# --- Foxglove: foxglove-sdk writes, mcap and mcap-protobuf-support read -----------------------------


def read_foxglove(path):
    reader = pytest.importorskip("mcap.reader", reason="mcap is not installed")
    decoder = pytest.importorskip("mcap_protobuf.decoder", reason="mcap-protobuf-support is not installed")

    class Json:
        def decoder_for(self, encoding, schema):
            return json.loads if encoding == "json" else None

    with open(path, "rb") as file:
        made = reader.make_reader(file, decoder_factories=[decoder.DecoderFactory(), Json()])
        return [(schema.name, channel.topic, message, decoded)
                for schema, channel, message, decoded in made.iter_decoded_messages()]


def test_a_foxglove_file_is_the_drive(driven, drive_json, tmp_path):
    pytest.importorskip("foxglove", reason="foxglove-sdk is not installed")
    setting, moments = driven
    path = tmp_path / "drive.mcap"
    with robot.Foxglove(setting, file=path) as out:
        for moment in moments:
            out.add(moment)
    messages = read_foxglove(path)
    assert {(t, k) for k, t, _, _ in messages} == {
        ("/tf", "foxglove.FrameTransforms"), ("/blindcorner/sign/pose", "foxglove.PoseInFrame"),
        ("/blindcorner/grid", "foxglove.Grid"), ("/blindcorner/markers", "foxglove.SceneUpdate"),
        ("/blindcorner/scene", "foxglove.SceneUpdate"), ("/blindcorner/plan", "foxglove.PosesInFrame"),
        ("/blindcorner/zones", "foxglove.LaserScan"), ("/blindcorner/answer", "blindcorner.answer")}
    grids = of_topic(messages, "/blindcorner/grid")
    assert len(grids) == len(moments)
    for moment, (log_time, grid) in zip(moments, grids):
        assert log_time == round(moment.time_s * 1e9) == grid.timestamp.ToNanoseconds()
        cells = np.frombuffer(grid.data, "<f4").reshape(-1, grid.column_count)
        np.testing.assert_allclose(cells, moment.occupancy, atol=1e-7)
        assert (grid.fields[0].name, grid.cell_size.x) == ("probability", 0.05)
    stated = [m for m in moments if m.presence is not None and m.presence >= 0.5 and m.modes]
    for moment, (_, pose) in zip(stated, of_topic(messages, "/blindcorner/sign/pose")):
        assert (pose.pose.position.x, pose.pose.position.y) == tuple(moment.modes[0].pose)
        assert pose.frame_id == "map"
    for moment, (_, transforms) in zip(moments, of_topic(messages, "/tf")):
        base, sensor = transforms.transforms
        assert (base.parent_frame_id, sensor.parent_frame_id) == ("map", "base_link")
        assert base.translation.y == moment.vehicle.y_m
    names = [e.id for e in of_topic(messages, "/blindcorner/markers")[-1][1].entities]
    assert {"sign/0/ellipse95", "sign/truth", "vehicle", "zones"} <= set(names)
    answer = of_topic(messages, "/blindcorner/answer")[-1][1]
    assert answer["flags"] == moments[-1].flags and answer["frame"] == moments[-1].notes["frame"]


def test_the_command_writes_all_three_from_a_file(drive_json, tmp_path):
    for library in ("foxglove", "rosbags", "commonroad"):
        pytest.importorskip(library, reason=f"{library} is not installed")
    out = tmp_path / "new"
    assert main(["drive", str(drive_json), "--foxglove", str(out / "a.mcap"), "--ros2", str(out / "bag"),
                 "--commonroad", str(out / "a.xml")]) == 0
    assert sorted(p.name for p in out.iterdir()) == ["a.mcap", "a.solution.xml", "a.xml", "bag"]
    assert sorted(p.name for p in (out / "bag").iterdir()) == ["bag.mcap", "metadata.yaml"]


def test_tracks_keep_their_times(scene, several, tmp_path):
    pytest.importorskip("foxglove", reason="foxglove-sdk is not installed")
    tracker = bc.Tracker(scene)
    for capture in several[:3]:
        tracker.advance(capture, dt=0.25)
    tracker.results().save(tmp_path)
    assert main(["result", str(tmp_path), "--foxglove", str(tmp_path / "a.mcap")]) == 0
    answers = of_topic(read_foxglove(tmp_path / "a.mcap"), "/blindcorner/answer")
    assert [time for time, _ in answers] == [0, 250_000_000, 500_000_000]


def test_live_answers_go_to_a_file(scene, result, tmp_path):
    pytest.importorskip("foxglove", reason="foxglove-sdk is not installed")
    text = live_text(result, scene, [0.0, 0.5])
    program = [sys.executable, "-c", f"print({text!r}, end='')"]
    done = subprocess.run(
        [sys.executable, "-m", "blindcorner.robot", "live", "--foxglove", str(tmp_path / "a.mcap"),
         "--start", "7", "--", *program], capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stderr) == (0, "")
    messages = read_foxglove(tmp_path / "a.mcap")
    (first, answer), (second, _) = of_topic(messages, "/blindcorner/answer")
    assert (first, second) == (7_000_000_000, 7_500_000_000) and answer["latency_ms"] == 5.0
    pose = of_topic(messages, f"/blindcorner/{scene.objects[0]}/pose")[0][1]
    assert pose.pose.position.x == result.modes[0].pose[0]


def wait_until_idle(process, quiet_s=1.0, patience_s=60):
    """Until a process has taken no processor time for a while: it has done what it was told."""
    end, used = time.monotonic() + patience_s, -1
    while time.monotonic() < end:
        # Fields 14 and 15 of proc(5), after the name in parentheses.
        fields = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
        before, used = used, int(fields[11]) + int(fields[12])
        if used == before:
            return
        time.sleep(quiet_s)
    raise AssertionError("the process is still busy")


def test_ctrl_c_leaves_whole_files(scene, result, tmp_path):
    for library in ("foxglove", "rosbags"):
        pytest.importorskip(library, reason=f"{library} is not installed")
    text = live_text(result, scene, [0.0, 0.5])
    process = subprocess.Popen(
        [sys.executable, "-m", "blindcorner.robot", "live", "--foxglove", str(tmp_path / "a.mcap"),
         "--ros2", str(tmp_path / "bag"), "--start", "7", "--serve", "--port", "0"],
        stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    process.stdin.write(text)
    process.stdin.flush()
    assert process.stderr.readline().startswith("Foxglove: ws://127.0.0.1:")
    wait_until_idle(process)
    process.send_signal(signal.SIGINT)
    assert process.stderr.read() == "blindcorner: interrupted; files hold what came until then\n"
    process.stdin.close()
    process.stderr.close()
    assert process.wait(timeout=60) == 1
    assert len(of_topic(read_foxglove(tmp_path / "a.mcap"), "/blindcorner/answer")) == 2
    from rosbags.highlevel import AnyReader

    with AnyReader([tmp_path / "bag"]) as reader:
        assert reader.topics["/blindcorner/answer"].msgcount == 2


def test_drives_are_served_at_their_pace(drive_json, driven, capfd):
    pytest.importorskip("foxglove", reason="foxglove-sdk is not installed")
    lasts = driven[1][-1].time_s - driven[1][0].time_s
    begin = time.monotonic()
    assert main(["drive", str(drive_json), "--serve", "--port", "0", "--pace", "4"]) == 0
    assert time.monotonic() - begin >= lasts / 4
    assert capfd.readouterr().err.startswith("Foxglove: ws://127.0.0.1:")
    assert main(["drive", str(drive_json), "--serve", "--host", "0.0.0.1"]) == 2
    assert "0.0.0.1:8765: no server can listen there" in capfd.readouterr().err


def test_viewers_of_this_machine_get_live_answers(scene, result):
    """A client that speaks Foxglove's protocol gets what is read from standard input afterwards."""
    pytest.importorskip("foxglove", reason="foxglove-sdk is not installed")
    client = pytest.importorskip("websockets.sync.client", reason="websockets is not installed")
    lines = live_text(result, scene, [0.0, 0.5]).splitlines(keepends=True)
    process = subprocess.Popen(
        [sys.executable, "-m", "blindcorner.robot", "live", "--serve", "--port", "0"],
        stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        process.stdin.writelines(lines[:2])
        process.stdin.flush()
        address = process.stderr.readline().split()[-1]
        assert address.startswith("ws://127.0.0.1:")
        with client.connect(address, subprotocols=["foxglove.sdk.v1"], max_size=None) as viewer:
            channels = {}
            while "/blindcorner/answer" not in channels:
                message = viewer.recv(timeout=60)
                if isinstance(message, str) and json.loads(message)["op"] == "advertise":
                    channels.update({c["topic"]: c["id"] for c in json.loads(message)["channels"]})
            viewer.send(json.dumps({"op": "subscribe", "subscriptions": [
                {"id": 1, "channelId": channels["/blindcorner/answer"]}]}))
            time.sleep(1)  # the server has no reply to a subscription
            process.stdin.write(lines[2])
            process.stdin.flush()
            data = viewer.recv(timeout=60)
            while isinstance(data, str) or data[0] != 1:
                data = viewer.recv(timeout=60)
        # Opcode, subscription, time in ns, then the message.
        assert json.loads(data[13:])["time_s"] == 0.5
    finally:
        process.stdin.close()
        assert process.wait(timeout=60) == 0
        process.stderr.close()


# --- CommonRoad -------------------------------------------------------------------------------------


def follows(schema, path):
    """Whether a file follows a schema that comes with commonroad-io, and why not."""
    import commonroad.common
    from lxml import etree

    folder = Path(commonroad.common.__file__).parent / "xml_definition_files"
    checked = etree.XMLSchema(etree.parse(str(folder / schema)))
    assert checked.validate(etree.parse(str(path))), checked.error_log


def test_commonroad_reads_the_drive(driven, run, tmp_path):
    reader = pytest.importorskip("commonroad.common.file_reader", reason="commonroad-io is not installed")
    from commonroad.common.solution import CommonRoadSolutionReader

    setting, moments = driven
    robot.write_commonroad(tmp_path / "drive.xml", setting, moments)
    follows("XML_commonRoad_XSD.xsd", tmp_path / "drive.xml")
    follows("CommonRoadSolution_schema.xsd", tmp_path / "drive.solution.xml")
    scenario, problems = reader.CommonRoadFileReader(str(tmp_path / "drive.xml")).open()
    assert scenario.dt == pytest.approx(0.2)
    # Two walls and the inner corner; the floor is no obstacle. The sign stands all the time.
    assert len(scenario.static_obstacles) == 3
    (sign,) = scenario.dynamic_obstacles
    sign = sign.occupancy_at_time(len(moments) - 1)
    np.testing.assert_allclose((sign.center.x, sign.center.y), moments[0].truth, atol=1e-3)
    # A plate of 0.3 m whose normal points to -20 degrees.
    assert (sign.length, math.tan(sign.orientation)) == pytest.approx(
        (0.3, math.tan(math.radians(70))), abs=2e-3)
    corner = scenario.static_obstacles[2].occupancy_at_time(0).shapely_object
    np.testing.assert_allclose(corner.bounds, (-4, 1, 0, 4), atol=1e-3)
    solution = CommonRoadSolutionReader.open(str(robot.solution_path(tmp_path / "drive.xml")))
    assert solution.benchmark_id.endswith(str(scenario.scenario_id) + ":2020a")
    (part,) = solution.planning_problem_solutions
    states = part.trajectory.state_list
    np.testing.assert_allclose([s.position for s in states],
                               [(m.vehicle.x_m, m.vehicle.y_m) for m in moments])
    speeds = np.hypot([s.velocity for s in states], [s.velocity_y for s in states])
    np.testing.assert_allclose(speeds, [m.vehicle.speed_m_per_s for m in moments], atol=1e-9)
    (problem,) = problems.planning_problem_dict.values()
    # The lanelet holds the whole way.
    (lanelet,) = scenario.lanelet_network.lanelets
    assert lanelet.polygon.shapely_object.is_valid
    assert all(scenario.lanelet_network.find_lanelet_by_position([s.position for s in states]))
    assert run.outcome == "reached" and problem.goal_reached(part.trajectory)[0]


def test_commonroad_knows_what_moves(tmp_path):
    reader = pytest.importorskip("commonroad.common.file_reader", reason="commonroad-io is not installed")
    run = bc.drive(bc.bundled("crossing_cyclist_drive.json"), perception="oracle", seed=3, pictures=False)
    setting, moments = robot.of_run(run)
    robot.write_commonroad(tmp_path / "drive.xml", setting, moments)
    follows("XML_commonRoad_XSD.xsd", tmp_path / "drive.xml")
    scenario, _ = reader.CommonRoadFileReader(str(tmp_path / "drive.xml")).open()
    (cyclist,) = scenario.dynamic_obstacles
    assert cyclist.obstacle_type.value == "bicycle"
    for step in (0, len(moments) - 1):
        state = cyclist.state_at_time(step)
        np.testing.assert_allclose(state.position, moments[step].truth[:2], atol=1e-3)
    assert cyclist.state_at_time(1).orientation == pytest.approx(moments[1].truth[2], abs=1e-3)
    with pytest.raises(bc.Error, match="found no vehicle, accepted: a drive"):
        robot.write_commonroad(tmp_path / "a.xml", setting, [robot.Moment(0.0)])

# SPDX-License-Identifier: Apache-2.0
"""The node with a stand-in for rclpy: what goes in and what comes out, compared with the package."""

import array
import json
import math
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="rosbags is not installed")
sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parent.parent)]

import stand_in  # noqa: E402

stand_in.install()

import blindcorner as bc  # noqa: E402
from blindcorner import robot  # noqa: E402
from blindcorner_ros import messages, node  # noqa: E402

SECOND = 10**9


@pytest.fixture(scope="module")
def scene():
    return bc.Scene.load(bc.bundled("tmf8828_wall.json"))


@pytest.fixture(scope="module")
def frames(scene):
    """[frames, zones, bins] counts of an object that stands."""
    cubes = [bc.render(scene, photons=5000, seed=seed, model="fast").counts[0] for seed in (1, 2, 3)]
    return np.rint(cubes)


@pytest.fixture
def world(monkeypatch):
    made = stand_in.World()
    monkeypatch.setattr(stand_in, "WORLD", made)
    made.parameters = {"scene": "tmf8828_wall.json", "histogram_type": "stamped_msgs/msg/Measure",
                       "use_tf": False}
    return made


@pytest.fixture
def start(world):
    """Starts the node with parameters; ends it after the test."""
    started = []

    def starter(**parameters):
        world.parameters.update(parameters)
        started.append(node.AroundCorner())
        return started[-1]

    yield starter
    for each in started:
        each.destroy_node()


def measure(counts, stamp_ns=0, kind="stamped_msgs/msg/Measure", **fields):
    """A driver's message."""
    message = stand_in.get_message(kind)(
        num_zones=counts.shape[0], num_bins=counts.shape[1],
        hists=array.array("q", counts.astype(int).ravel().tolist()), **fields)
    if stamp_ns:
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, SECOND)
    return message


def answers(world):
    return [json.loads(m.data) for m in world.published["/blindcorner/answer"]]


def arrives(world, message, number):
    """Hands a message to the node and waits for so many answers."""
    world.callbacks["tmf882x"](message)
    assert world.wait(lambda: len(answers(world)) >= number
                      and len(world.published["/blindcorner/markers"]) >= number), world.warnings


def test_answers_are_those_of_the_package(world, start, scene, frames):
    start()
    at = 1_700_000_001_000_000_007
    for i, counts in enumerate(frames):
        arrives(world, measure(counts, at + i * SECOND // 5), i + 1)
    tracker = bc.Tracker(scene)
    pose = world.published[f"/blindcorner/{scene.objects[0]}/pose"]
    for i, counts in enumerate(frames):
        result = tracker.advance(bc.Captures(counts, rows=3, columns=3), dt=0.2 if i else None)
        assert world.published["/blindcorner/presence"][i].data == pytest.approx(
            result.presence_probability, abs=1e-9)
        stamp = pose[i].header.stamp
        # To the nanosecond: other nodes match messages by their stamps.
        assert stamp.sec * SECOND + stamp.nanosec == at + i * SECOND // 5
        place = pose[i].pose.pose.position
        np.testing.assert_allclose([place.x, place.y, place.z], result.modes[0].pose[:3], atol=1e-6)
        turn = pose[i].pose.pose.orientation
        assert math.remainder(2 * math.atan2(turn.z, turn.w) - result.modes[0].pose[3],
                              2 * math.pi) == pytest.approx(0, abs=1e-6)
        covariance = pose[i].pose.covariance.reshape(6, 6)[[0, 1, 2, 5]][:, [0, 1, 2, 5]]
        np.testing.assert_allclose(covariance, result.modes[0].covariance, rtol=1e-4, atol=1e-9)
    assert [a["frame"] for a in answers(world)] == [0, 1, 2] and answers(world)[0]["latency_ms"] > 0


def test_the_grid_is_that_of_the_answer(world, start, scene, frames):
    made = start(cell_m=0.05)
    arrives(world, measure(frames[0], SECOND), 1)
    (grid,) = world.published["/blindcorner/grid"]
    result = bc.Tracker(scene).advance(bc.Captures(frames[0], rows=3, columns=3))
    moment = robot.of_answer(result.to_dict()["captures"][0], 0.0)
    cells = np.reshape(grid.data, (grid.info.height, grid.info.width))
    np.testing.assert_allclose(cells, 100 * made.setting.occupancy(moment), atol=0.51)
    assert grid.info.resolution == 0.05 and cells.max() > 10


def test_tf_says_where_the_sensor_was(world, start, scene, frames):
    """Without it a frame is left out; with it the capture is from there."""
    start(use_tf=True, sensor_frame="tof", map_frame="hall")
    moved = scene.sensor_pose.copy()
    stamped = robot.RosMessages(messages.make).transform("hall", "tof", moved, 0.0)
    at = 1_700_000_000 * SECOND + 5
    world.callbacks["tmf882x"](measure(frames[0], at))
    assert world.wait(lambda: world.warnings)
    assert 'frame left out: tf: "tof" does not exist' in world.warnings[0] and not answers(world)
    world.transforms["hall", "tof"] = stamped
    arrives(world, measure(frames[0], at), 1)
    assert world.asked[-1] == ("hall", "tof", at)
    usual = bc.Tracker(scene).advance(bc.Captures(frames[0], rows=3, columns=3))
    first = world.published["/blindcorner/presence"][0].data
    assert first == pytest.approx(usual.presence_probability, abs=1e-9)
    # A sensor that stands elsewhere: what the package says of a capture from there.
    moved[0, 3] += 0.1
    world.transforms["hall", "tof"] = robot.RosMessages(messages.make).transform("hall", "tof", moved, 0.0)
    arrives(world, measure(frames[0], at + SECOND), 2)
    tracker = bc.Tracker(scene)
    tracker.advance(bc.Captures(frames[0], rows=3, columns=3))
    there = tracker.advance(bc.Captures(frames[0], rows=3, columns=3, sensor_poses=moved[None]), dt=1.0)
    place = world.published[f"/blindcorner/{scene.objects[0]}/pose"][1].pose.pose.position
    np.testing.assert_allclose([place.x, place.y], there.modes[0].pose[:2], atol=1e-6)
    assert "/tf_static" not in world.published  # the robot's to say


def test_what_rests_is_kept_for_whoever_comes_later(world, start, scene):
    start()
    (static,), (walls,) = world.published["/tf_static"], world.published["/blindcorner/scene"]
    assert {world.quality[t].durability for t in ("/tf_static", "/blindcorner/scene")} == {"transient local"}
    (link,) = static.transforms
    assert (link.header.frame_id, link.child_frame_id) == ("map", "blindcorner_sensor")
    np.testing.assert_allclose(messages.matrix(link.transform), scene.sensor_pose, atol=1e-12)
    assert len(walls.markers) == 1 + len(scene.to_dict()["surfaces"])


def test_messages_without_a_header_are_of_now(world, start, frames):
    start(histogram_type=stand_in.MESSAGE, i2c_address=65, markers=False)
    kind = stand_in.MESSAGE
    world.callbacks["tmf882x"](measure(frames[0], kind=kind, i2c_address=66))
    world.callbacks["tmf882x"](measure(frames[1], kind=kind, i2c_address=65))
    assert world.wait(lambda: answers(world)), world.warnings
    stamp = world.published["/blindcorner/grid"][0].header.stamp
    assert stamp.sec * SECOND + stamp.nanosec == world.now_ns
    assert answers(world)[0]["skipped"] == 0 and "/blindcorner/markers" not in world.published


@pytest.mark.parametrize("sizes", [(9, 128), (3, 3, 128)])
def test_plain_arrays_are_taken_as_their_layout_says(world, start, frames, sizes):
    start(histogram_type="std_msgs/msg/Float64MultiArray")
    layout = messages.make("std_msgs/msg/MultiArrayLayout", dim=[
        messages.make("std_msgs/msg/MultiArrayDimension", size=size) for size in sizes])
    arrives(world, messages.make("std_msgs/msg/Float64MultiArray", layout=layout,
                                 data=frames[0].ravel()), 1)
    world.now_ns += SECOND
    world.callbacks["tmf882x"](messages.make("std_msgs/msg/Float64MultiArray", data=frames[0].ravel()))
    assert world.wait(lambda: world.warnings)
    assert world.warnings == ["frame left out: a layout of 0 dimensions"]


def test_frames_that_cannot_be_used_are_named(world, start, frames):
    start()
    world.callbacks["tmf882x"](measure(frames[0][:4], SECOND))
    assert world.wait(lambda: world.warnings)
    assert world.warnings[-1] == (
        "frame left out: histograms: found 4 zones of 128 bins, accepted: 9 of 128")
    broken = measure(frames[0], SECOND)
    broken.num_bins = 100
    world.callbacks["tmf882x"](broken)
    assert world.wait(lambda: len(world.warnings) == 2) and "reshape" in world.warnings[-1]
    arrives(world, measure(frames[0], SECOND), 1)


def test_a_clock_that_goes_back_begins_anew(world, start, scene, frames):
    start()
    arrives(world, measure(frames[0], 10 * SECOND), 1)
    arrives(world, measure(frames[1], 11 * SECOND), 2)
    arrives(world, measure(frames[0], 5 * SECOND), 3)
    assert world.warnings == ["time went back: tracking begins anew"]
    presence = [m.data for m in world.published["/blindcorner/presence"]]
    assert presence[2] == pytest.approx(presence[0], abs=1e-12)


def test_the_newest_frame_is_taken_and_the_others_counted():
    box = node.Newest()
    for item in (1, 2, 3):
        box.put(item)
    assert (box.take(), box.skipped) == (3, 2)
    box.close()
    assert box.take() is None


@pytest.mark.parametrize("parameters, told", [
    ({"scene": ""}, 'parameter scene: found "", accepted: a scene file, or the name of a bundled one'),
    ({"scene": "none.json"}, 'bundled: found "none.json", accepted: '),
    ({"histogram_type": "none/msg/None"}, 'parameter histogram_type: found "none/msg/None", accepted: a'),
    ({"histogram_type": "std_msgs/msg/Header"}, 'with frame_id, stamp, accepted: a message with hists'),
    ({"prefix": "a b"}, 'prefix: found "a b", accepted: letters'),
])
def test_wrong_parameters_are_told_in_one_line(world, capsys, parameters, told):
    world.parameters.update(parameters)
    assert node.main() == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1 and told in lines[0]


def test_the_file_of_parameters_holds_the_defaults():
    yaml = pytest.importorskip("ruamel.yaml", reason="ruamel.yaml is not installed")
    file = Path(__file__).parent.parent / "config" / "blindcorner.yaml"
    held = yaml.YAML(typ="safe").load(file.read_text())["around_corner"]["ros__parameters"]
    assert held == node.PARAMETERS
    assert {k: type(v) for k, v in held.items()} == {k: type(v) for k, v in node.PARAMETERS.items()}

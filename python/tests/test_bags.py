# SPDX-License-Identifier: Apache-2.0
"""ROS 2 bags, written by rosbags: with the driver's own message, and with an array of histograms."""

import sqlite3

import numpy as np
import pytest

import blindcorner as bc

rosbag2 = pytest.importorskip("rosbags.rosbag2", reason="rosbags is not installed")
from rosbags.typesys import Stores, get_types_from_msg, get_typestore  # noqa: E402

from blindcorner._bags import DEFINITION, MESSAGE  # noqa: E402

FRAME = "demo_interfaces/msg/HistogramFrame"
PART = "demo_interfaces/msg/Histogram"


@pytest.fixture(scope="module")
def store():
    types = get_typestore(Stores.ROS2_HUMBLE)
    types.register(get_types_from_msg(DEFINITION, MESSAGE))
    types.register(get_types_from_msg("int32 channel\nint32[] bins", PART))
    types.register(get_types_from_msg(f"std_msgs/Header header\n{PART}[] histograms", FRAME))
    return types


def measure(store, counts, address=65):
    """The driver's message; counts [zones, bins], or empty."""
    flat = np.asarray(counts, dtype=np.int64)
    zones, bins = flat.shape if flat.ndim == 2 else (9, 128)
    none = np.empty(0, dtype=np.int64)
    return store.types[MESSAGE](
        num_zones=zones, num_bins=bins, reference_hist=np.zeros(bins, dtype=np.int64), hists=flat.ravel(),
        i2c_address=address, measurement_num=1, temperature=30, num_valid_results=9, tick=5, depths_1=none,
        confs_1=none, depths_2=none, confs_2=none, histogram_type="raw", port="")


def write(store, path, messages, plugin="SQLITE3"):
    """A bag of (topic, message)."""
    with rosbag2.Writer(path, version=9, storage_plugin=rosbag2.StoragePlugin[plugin]) as bag:
        connections = {}
        for time, (topic, message) in enumerate(messages):
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = bag.add_connection(topic, kind, typestore=store)
            bag.write(connections[topic], time, store.serialize_cdr(message, kind))
    return path


@pytest.fixture
def frames(several):
    return np.round(several.counts[:3])


@pytest.mark.parametrize("plugin", ["SQLITE3", "MCAP"])
def test_bags_come_back_as_captures(store, frames, tmp_path, plugin):
    bag = write(store, tmp_path / "bag", [("/tmf882x", measure(store, f)) for f in frames], plugin)
    with pytest.warns(UserWarning, match="9 zones are taken as 3 rows of 3"):
        captures = bc.import_captures(bag, bin_width_ps=88)
    np.testing.assert_array_equal(captures.counts, frames)
    assert (captures.rows, captures.columns, captures.bin_width_ps) == (3, 3, 88)
    # The file in the bag's directory stands for the bag.
    with pytest.warns(UserWarning):
        again = bc.import_captures(next(p for p in bag.iterdir() if p.suffix in (".db3", ".mcap")))
    np.testing.assert_array_equal(again.counts, frames)


def test_captures_of_a_bag_are_fitted(store, scene, frames, tmp_path):
    bag = write(store, tmp_path / "bag", [("/tmf882x", measure(store, frames[0]))])
    with pytest.warns(UserWarning):
        captures = bc.import_captures(bag, truth=[{"x_m": 0.3}])
    captures.save(tmp_path / "bag.exr")
    assert bc.load_captures(tmp_path / "bag.exr").truth == [{"x_m": 0.3}]
    assert bc.fit(scene, captures).modes


def test_arrays_of_histograms_are_recognised(store, frames, tmp_path):
    header = store.types["std_msgs/msg/Header"](
        stamp=store.types["builtin_interfaces/msg/Time"](sec=1, nanosec=2), frame_id="tof")
    parts = [store.types[PART](channel=i, bins=row.astype(np.int32)) for i, row in enumerate(frames[0])]
    bag = write(store, tmp_path / "bag", [("/tof", store.types[FRAME](header=header, histograms=parts))], "MCAP")
    with pytest.warns(UserWarning):
        np.testing.assert_array_equal(bc.import_captures(bag).counts[0], frames[0])


def test_what_is_odd_is_told_and_the_rest_kept(store, frames, tmp_path):
    broken = measure(store, frames[0])
    broken.num_bins = 100
    messages = [measure(store, frames[0]), measure(store, []), broken, measure(store, frames[1][:4])]
    bag = write(store, tmp_path / "bag", [("/a", m) for m in messages])
    with pytest.warns(UserWarning) as told:
        captures = bc.import_captures(bag)
    assert len(captures) == 1 and captures.indices == [0]
    text = "\n".join(str(w.message) for w in told)
    assert "1 of 4 messages hold no histograms" in text and "message 2: is left out" in text
    assert "1 messages of 4 zones" in text


def test_a_bag_is_read_up_to_a_damaged_message(store, frames, tmp_path):
    bag = write(store, tmp_path / "bag", [("/a", measure(store, f)) for f in frames])
    with sqlite3.connect(next(bag.glob("*.db3"))) as database:
        database.execute("UPDATE messages SET data = substr(data, 1, 100) WHERE timestamp = 2")
    with pytest.warns(UserWarning, match="ends with message 1"):
        np.testing.assert_array_equal(bc.import_captures(bag).counts, frames[:2])


def test_several_sensors_are_told_apart(store, frames, tmp_path):
    messages = [("/a", measure(store, frames[0], 65)), ("/b", measure(store, frames[1], 66)),
                ("/b", measure(store, frames[2], 67))]
    bag = write(store, tmp_path / "bag", messages)
    with pytest.raises(bc.Error, match="topics /a, /b"):
        bc.import_captures(bag)
    with pytest.raises(bc.Error, match="addresses 66, 67"):
        bc.import_captures(bag, topic="/b")
    with pytest.warns(UserWarning):
        np.testing.assert_array_equal(bc.import_captures(bag, topic="/b", i2c_address=67).counts[0], frames[2])
    with pytest.raises(bc.Error, match="topic: found /c"):
        bc.import_captures(bag, topic="/c")


def test_other_bags_are_refused_in_one_line(store, tmp_path):
    text = store.types["std_msgs/msg/String"](data="a")
    bag = write(store, tmp_path / "bag", [("/chatter", text)])
    with pytest.raises(bc.Error, match="found messages of type std_msgs/msg/String, accepted: .*hists"):
        bc.import_captures(bag)
    (tmp_path / "cut.mcap").write_bytes(b"\x89MCAP0\r\n")
    with pytest.raises(bc.Error, match="cut.mcap: cannot be read as a bag"):
        bc.import_captures(tmp_path / "cut.mcap")
    with pytest.raises(bc.Error, match="none.db3"):
        bc.import_captures(tmp_path / "none.db3")

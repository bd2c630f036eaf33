# SPDX-License-Identifier: Apache-2.0
import pickle

import numpy as np
import pytest

import blindcorner as bc


def test_capture_file_is_a_numpy_array_with_metadata(capture):
    assert capture.counts.shape == (1, 9, 128) and capture.counts.dtype == np.float64
    assert capture.bin_width_ps == 88
    assert capture.truth[0]["x_m"] == 0.28
    assert capture.sensor_poses.shape == (1, 4, 4)
    assert capture.cube().base is not None and capture.cube().shape == (1, 3, 3, 128)
    assert "3 x 3 zones" in repr(capture)


def test_numpy_memory_is_not_copied():
    counts = np.ones((5, 9, 128))
    captures = bc.Captures(counts)
    assert np.shares_memory(captures.counts, counts)
    assert np.shares_memory(captures[1:3].counts, counts)
    assert np.shares_memory(captures[-1].counts, counts)
    assert [c.indices for c in captures[1:3]] == [[1], [2]]
    with pytest.raises(IndexError):
        captures[5]


@pytest.mark.parametrize("ending", ["exr", "npz"])
def test_saved_captures_come_back(several, tmp_path, ending):
    path = tmp_path / f"captures.{ending}"
    several.save(path)
    again = bc.load_captures(path) if ending == "exr" else bc.import_captures(path)
    np.testing.assert_allclose(again.counts, several.counts, rtol=1e-6)
    assert again.truth == several.truth
    np.testing.assert_allclose(again.sensor_poses, several.sensor_poses, atol=1e-12)


def test_pickled_captures_come_back(several):
    again = pickle.loads(pickle.dumps(several[2]))
    assert (again.counts == several[2].counts).all() and again.truth == several[2].truth


def test_own_arrays_with_poses_and_truth_reach_the_file(tmp_path):
    pose = np.eye(4)
    pose[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    pose[:3, 3] = [1, 2, 3]
    captures = bc.Captures(np.ones((2, 4, 8)), bin_width_ps=100, exposures=3, dispersion=1.5,
                           truth=[{"x_m": 1}, {"x_m": 2}], sensor_poses=[pose, pose])
    captures.save(tmp_path / "own.exr")
    again = bc.load_captures(tmp_path / "own.exr")
    np.testing.assert_allclose(again.sensor_poses[1], pose, atol=1e-12)
    assert again.truth[1] == {"x_m": 2} and (again.exposures == 3).all()


def test_wrong_shapes_are_named(tmp_path):
    with pytest.raises(bc.Error, match="found 1 axes"):
        bc.Captures(np.ones(3))
    with pytest.raises(bc.Error, match="found 8 zones, accepted: 3 x 3"):
        bc.Captures(np.ones((8, 4)))
    with pytest.raises(bc.Error, match="truth: found 1, accepted: 2"):
        bc.Captures(np.ones((2, 4, 8)), truth=[{}])
    with pytest.raises(bc.Error, match="exposures"):
        bc.Captures(np.ones((1, 4, 8)), exposures=-1).save(tmp_path / "x.exr")


def test_import_tells_what_it_assumes(tmp_path):
    np.save(tmp_path / "a.npy", np.ones((2, 9, 16), dtype=np.uint16))
    with pytest.warns(UserWarning, match="9 zones as 3 rows of 3"):
        captures = bc.import_captures(tmp_path / "a.npy", axes="capture,zone,bin", bin_width_ps=50)
    assert captures.counts.shape == (2, 9, 16) and captures.bin_width_ps == pytest.approx(50)
    with pytest.raises(bc.Error, match="bin is missing"):
        bc.import_captures(tmp_path / "a.npy", axes="zone")
    with pytest.raises(bc.Error, match="format"):
        bc.import_captures(tmp_path / "a.npy", format="unheard_of")


def test_any_text_table_is_read_by_its_columns(tmp_path):
    (tmp_path / "log.txt").write_text("".join(f"H;{z};{z},5;{2 * z}\n" for z in range(4)))
    with pytest.warns(UserWarning, match="2 rows of 2"):
        captures = bc.import_captures(tmp_path / "log.txt", pattern="'H',zone,counts")
    np.testing.assert_array_equal(captures.counts[0], [[0.5, 0], [1.5, 2], [2.5, 4], [3.5, 6]])
    with pytest.raises(bc.Error, match="tmf8829: .*#HLONG.*--pattern"):
        bc.import_captures(tmp_path / "log.txt")


def test_render_is_what_the_program_renders(scene, program, tmp_path):
    program("render", scene.path, "-o", tmp_path / "p.exr", "--pose", "x_m=0.3,yaw_deg=-30", "--photons",
            500, "--seed", 7)
    there = bc.load_captures(tmp_path / "p.exr")
    here = bc.render(scene, pose={"x_m": 0.3, "yaw_deg": -30}, photons=500, seed=7)
    np.testing.assert_allclose(here.counts, there.counts, rtol=1e-6)  # the file holds floats
    assert here.truth == there.truth


def test_render_takes_poses_of_object_and_sensor(scene):
    moved = scene.sensor_pose.copy()
    moved[1, 3] += 0.01
    captures = bc.render(scene, pose=scene.pose(x_m=0.2), sensor_pose=[scene.sensor_pose, moved],
                         noiseless=True, model="fast")
    assert len(captures) == 2 and captures.truth[0]["x_m"] == 0.2
    np.testing.assert_allclose(captures.sensor_poses[1], moved, atol=1e-9)
    assert not np.array_equal(captures.counts[0], captures.counts[1])
    by_name = bc.render(scene, pose={"x_m": 0.2}, sensor_pose={"y_m": moved[1, 3]}, noiseless=True,
                        model="fast")
    np.testing.assert_allclose(by_name.counts[0], captures.counts[1], rtol=1e-12)
    with pytest.raises(bc.Error, match="poses of the object"):
        bc.render(scene, pose=[{}, {}, {}], sensor_pose=[moved, moved])

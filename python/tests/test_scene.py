# SPDX-License-Identifier: Apache-2.0
import json
import pickle

import numpy as np
import pytest

import blindcorner as bc


def test_scene_says_what_its_file_says(scene):
    assert scene.unknowns == ["x_m", "y_m", "z_m", "yaw_rad"]
    assert scene.bounds.shape == (4, 2) and (scene.bounds[:, 0] < scene.bounds[:, 1]).all()
    assert (scene.rows, scene.columns, scene.bins) == (3, 3, 128)
    assert scene.bin_width_s == pytest.approx(88e-12)
    assert scene.sensor_pose.shape == (4, 4)
    assert "x_m" in repr(scene) and "3 x 3 zones" in repr(scene)


def test_scene_from_dict_is_the_scene_of_the_file(scene):
    again = bc.Scene.from_dict(scene.to_dict(), scene.path)
    assert again.unknowns == scene.unknowns and (again.bounds == scene.bounds).all()


def test_order_of_unknowns_is_that_of_the_fields(scene):
    fields = scene.to_dict()
    fields["unknowns"] = dict(reversed(list(fields["unknowns"].items())))
    assert bc.Scene.from_dict(fields, scene.path).unknowns == scene.unknowns[::-1]


def test_pickled_scene_is_the_same(scene):
    assert pickle.loads(pickle.dumps(scene)) == scene


def test_errors_name_file_field_and_what_is_accepted(scene, tmp_path):
    with pytest.raises(bc.Error, match="nowhere.json"):
        bc.Scene.load(tmp_path / "nowhere.json")
    with pytest.raises(bc.Error, match=r"presence_prior.*found 2.*accepted"):
        bc.Scene.from_dict({**scene.to_dict(), "presence_prior": 2})
    with pytest.raises(bc.Error, match="accepted: .*tmf8828"):
        bc.preset("tmf9999")


def test_presets_are_sensors_that_scenes_may_use(scene):
    assert "tmf8828_3x3_short" in bc.presets()
    for name in bc.presets():
        assert bc.preset(name)["bins"] > 0
    other = scene.with_fields(sensor={"preset": "tmf8828_4x4_short"})
    assert (other.rows, other.columns) == (4, 4)


def test_pose_by_names(scene):
    pose = scene.pose(x_m=0.2, yaw_deg=90)
    assert pose[0] == 0.2 and pose[3] == pytest.approx(np.pi / 2)
    assert (scene.pose(pose) == pose).all()
    with pytest.raises(bc.Error, match="accepted: x_m="):
        scene.pose(x=0.2)
    with pytest.raises(bc.Error, match=r"shape \(2,\)"):
        scene.pose([1, 2])


def test_bundled_names_what_there_is():
    with pytest.raises(bc.Error, match="tmf8828_wall.json"):
        bc.bundled("no_such_scene.json")


def test_region_behind_the_relay_is_told(scene):
    fields = scene.to_dict()
    fields["unknowns"]["x_m"] = [0.15, 30.0]
    assert bc.Scene.from_dict(fields, scene.path).hints()
    assert json.dumps(fields)

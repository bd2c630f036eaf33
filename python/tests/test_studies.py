# SPDX-License-Identifier: Apache-2.0
import json

import numpy as np
import pytest

import blindcorner as bc


def test_explanation_says_why(scene):
    explained = bc.explain(scene, x_m=0.3)
    assert explained.kernel == "lambertian"
    assert all(term["reason"] for term in explained.terms)
    assert explained.zones["three_bounce"].shape == (scene.zones,)
    assert -5 < explained.exponents["three_bounce_object"] < -2
    assert "signal to noise" in repr(explained)


def test_explained_counts_are_those_of_the_model(scene):
    with_object = bc.render(scene, pose={"x_m": 0.3}, noiseless=True, model="fast")
    without = bc.render(scene, noiseless=True, empty=True, model="fast")
    light = (with_object.counts - without.counts).sum()
    # Two tolerances of the fast model, 10 % and 1 %.
    assert bc.explain(scene, x_m=0.3).zones["three_bounce"].sum() == pytest.approx(light, rel=0.1)


def test_bound_falls_with_light(scene):
    dim = bc.bound(scene, photons=100, test_poses=50).at(x_m=0.3)
    bright = bc.bound(scene, photons=10_000, test_poses=50).at(x_m=0.3)
    assert bright.position_error_m < dim.position_error_m
    assert bright.photons == pytest.approx(100 * dim.photons, rel=1e-6)
    assert 0 <= dim.detection_probability <= 1
    assert np.trace(bright.cramer_rao) > 0 and "noticed" in repr(bright)
    with pytest.raises(bc.Error, match="test_poses"):
        bc.bound(scene, test_poses=-1)


def test_plan_is_what_the_program_plans(program, tmp_path):
    (tmp_path / "m.map").write_text(
        "type octile\nheight 5\nwidth 8\nmap\n........\n...@....\n...@....\n...@....\n........\n")
    program("plan", tmp_path / "m.map", "--start", "0.5,2.5", "--goal", "7.5,2.5", "-o", tmp_path)
    written = json.loads((tmp_path / "path.json").read_text())
    planned = bc.plan(tmp_path / "m.map", (0.5, 2.5), (7.5, 2.5))
    here = planned.to_dict()
    written.pop("time_ms")
    assert {k: v for k, v in here.items() if k != "time_ms"} == written
    assert planned.found and planned.points.shape[1] == 5
    planned.save(tmp_path / "python")
    assert (tmp_path / "python" / "path.html").exists()
    assert 'href="path.html"' in (tmp_path / "python" / "index.html").read_text()


def test_plan_on_an_array():
    occupancy = np.zeros((20, 30))
    occupancy[5:, 15] = 1
    planned = bc.plan(occupancy, (2, 10), (28, 10), radius_m=0.4)
    assert planned.found and planned.length_m > 26
    assert planned.points[:, 1].min() < 5  # around the lower end of the wall
    assert bc.plan(occupancy, (15.5, 10), (28, 10)).status == "start_blocked"
    with pytest.raises(bc.Error, match="accepted: both"):
        bc.plan(occupancy, (2, 10), (28, 10), vehicle_length_m=1)


def test_drive_is_what_the_program_drives(program, tmp_path):
    path = bc.bundled("robot_drive.json")
    program("drive", path, "-o", tmp_path, "--perception", "oracle", "--seed", 2, "--no-page")
    written = json.loads((tmp_path / "drive.json").read_text())
    times = []
    run = bc.drive(path, perception="oracle", seed=2, progress=times.append)
    here = run.to_dict()
    for document in (written, here):
        assert document.pop("program").startswith(f"blindcorner {bc.__version__} (")
        for frame in document["frames"]:
            frame.pop("time_ms", None)
    assert {k: v for k, v in here.items() if "time_ms" not in k} == {
        k: v for k, v in written.items() if "time_ms" not in k}
    assert times == sorted(times) and len(times) > 1
    assert run.trace.shape[1] == 3 and run.outcome in repr(run)
    assert "<svg" in run._core.animation() and run.page().lower().startswith("<!doctype html")


def test_drive_stops_where_progress_raises():
    def stop(time):
        raise RuntimeError("stop")

    with pytest.raises(RuntimeError, match="stop"):
        bc.drive(bc.bundled("robot_drive.json"), perception="los", pictures=False, progress=stop)
    with pytest.raises(bc.Error, match="accepted: .*oracle"):
        bc.drive(bc.bundled("robot_drive.json"), perception="guess")

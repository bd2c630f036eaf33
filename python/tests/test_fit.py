# SPDX-License-Identifier: Apache-2.0
import json
import os
import pickle
import signal
import threading
import time

import numpy as np
import pytest

import blindcorner as bc
from conftest import without_times


def test_result_is_what_the_program_writes(scene, capture, result, program, tmp_path):
    program("fit", scene.path, capture.sources[0], "-o", tmp_path)
    written = json.loads((tmp_path / "result.json").read_text())
    assert without_times(result.to_dict()) == without_times(written)
    # And its bytes, apart from the run times.
    result.save(tmp_path / "python")
    here = (tmp_path / "python" / "result.json").read_text()
    assert without_times(json.loads(here)) == without_times(written)
    assert list(json.loads(here)) == list(written)
    assert (tmp_path / "python" / "result.html").stat().st_size > 10_000


def test_many_results_are_what_the_program_writes(scene, several, program, tmp_path):
    several.save(tmp_path / "several.exr")
    captures = bc.load_captures(tmp_path / "several.exr")
    program("fit", scene.path, tmp_path / "several.exr", "-o", tmp_path / "out", "--no-page")
    written = json.loads((tmp_path / "out" / "result.json").read_text())
    results = bc.fit_each(scene, captures)
    assert without_times(results.to_dict()) == without_times(written)
    read = bc.load_results(tmp_path / "out")
    assert (read[3].mean == results[3].mean).all()


def test_joint_fit_is_what_the_program_writes(scene, several, program, tmp_path):
    moved = [several.sensor_poses[0] + np.outer([0, 1, 0, 0], [0, 0, 0, 0.02 * i]) for i in range(2)]
    captures = bc.render(scene, sensor_pose=moved, photons=2000, seed=5, model="fast")
    captures.save(tmp_path / "joint.exr")
    captures = bc.load_captures(tmp_path / "joint.exr")
    program("fit", scene.path, tmp_path / "joint.exr", "-o", tmp_path / "out", "--joint", "--no-page")
    written = json.loads((tmp_path / "out" / "result.json").read_text())
    joint = bc.fit_joint(scene, captures)
    assert without_times(joint.to_dict()) == without_times(written)
    assert joint.index == [0, 1]


def test_tracked_frames_are_what_the_program_writes(scene, several, program, tmp_path):
    several.save(tmp_path / "frames.exr")
    captures = bc.load_captures(tmp_path / "frames.exr")
    program("fit", scene.path, tmp_path / "frames.exr", "-o", tmp_path / "out", "--track", "--no-page")
    written = json.loads((tmp_path / "out" / "result.json").read_text())
    tracker = bc.Tracker(scene, captures)
    for frame in captures:
        tracker.advance(frame)
    assert without_times(tracker.results().to_dict()) == without_times(written)


def test_result_reads_as_numbers(result, scene):
    assert result.mean.shape == (4,) and result.covariance.shape == (4, 4)
    assert 0.99 < result.presence_probability <= 1
    assert sum(mode.weight for mode in result.modes) == pytest.approx(1)
    assert np.linalg.eigvalsh(result.modes[0].covariance).min() > 0
    assert result.truth[0] == 0.28
    text = repr(result)
    assert "x_m 0.26" in text and result.headline in text
    fitted = result.histograms[0]
    assert fitted.measured.shape == (scene.zones, scene.bins)
    assert not fitted.measured.flags.owndata  # it looks at the result's memory
    assert fitted.object.sum() < fitted.model.sum()


def test_histograms_outlive_their_result(scene, capture):
    measured = bc.fit(scene, capture, empty_captures=0).histograms[0].measured
    np.testing.assert_array_equal(measured, capture.counts[0])


def test_draws_scatter_as_the_posterior_says(result):
    draws = result.draw(40_000, seed=1)
    assert (result.draw(5, seed=2) == result.draw(5, seed=2)).all()
    # Moments of the mixture: four standard errors of 40,000 draws.
    sigma = np.sqrt(np.diag(result.covariance))
    assert (np.abs(draws.mean(axis=0) - result.mean) < 4 * sigma / 200).all()
    np.testing.assert_allclose(np.cov(draws.T), result.covariance,
                               atol=0.05 * np.outer(sigma, sigma).max())


def test_notebook_shows_the_page(result):
    html = result._repr_html_()
    assert html.startswith("<iframe") and "Bird" in html or "histogram" in html
    assert result.page().lower().startswith("<!doctype html")
    assert pickle.loads(pickle.dumps(result))._repr_html_().startswith("<pre>")


def test_errors_are_the_programs_line(scene, capture):
    with pytest.raises(bc.Error, match="3 x 3"):
        bc.fit(scene, bc.Captures(np.ones((1, 4, 128))))
    with pytest.raises(bc.Error, match="bin_width_ps: found 100"):
        bc.fit(scene, bc.Captures(capture.counts, bin_width_ps=100))
    with pytest.raises(bc.Error, match="found 2 captures, accepted: one"):
        bc.fit(scene, bc.Captures(np.ones((2, 9, 128))))
    with pytest.raises(bc.Error, match="max_starts"):
        bc.fit(scene, capture, starts=0)
    with pytest.raises(bc.Error, match="accepted: tolerance"):
        bc.fit(scene, capture, stars=1)
    counts = capture.counts.copy()
    counts[0, 0, 0] = np.nan
    results = bc.fit_each(scene, bc.Captures(counts))
    assert "NaN" in results[0].error or "finite" in results[0].error
    assert np.isnan(results[0].mean).all() and results[0].modes == []


def test_calibrated_scene_is_that_of_its_file(scene, tmp_path):
    empty = bc.render(scene, empty=True, random=4, seed=2, model="fast")
    shares = []
    found = bc.calibrate(scene, empty, no_object=True, progress=shares.append)
    assert shares and shares[-1] <= 1 and sorted(shares) == shares
    found.save(tmp_path / "instrument.json")
    read = bc.Scene.load(scene.path, tmp_path / "instrument.json")
    assert found.scene.to_dict() == read.to_dict()
    assert {"name", "value"} <= set(found.parameters[0])
    assert "Calibration of" in repr(found)


def test_progress_may_stop_a_fit_with_its_own_exception(scene, capture):
    seen = []

    def note(doing, share):
        seen.append(doing)
        if len(seen) == 2:
            raise KeyError("enough")

    fitter = bc.Fitter(scene, capture, progress=note)
    with pytest.raises(KeyError, match="enough"):
        fitter.fit(capture)
    # What was half made is made again.
    assert without_times(fitter.fit(capture).to_dict()) == without_times(
        bc.fit(scene, capture).to_dict())


def test_threads_get_the_results_of_one(scene, several):
    expected = [without_times(r.to_dict()) for r in bc.Fitter(scene, several).fit_each(several)]
    fitter = bc.Fitter(scene, several)
    found = [None] * len(several)

    def work(i):
        found[i] = without_times(fitter.fit(several[i]).to_dict())

    threads = [threading.Thread(target=work, args=(i,)) for i in range(len(several))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == expected


def test_interpreter_lock_is_free_while_a_fit_runs(scene, several):
    ticks, stop = [], threading.Event()

    def tick():
        while not stop.wait(0.001):
            ticks.append(time.monotonic())

    ticker = threading.Thread(target=tick)
    ticker.start()
    start = time.monotonic()
    bc.fit_each(scene, several)
    end = time.monotonic()
    stop.set()
    ticker.join()
    during = [t for t in ticks if start < t < end]
    # A held lock would leave none; of the possible ones some are lost on a busy machine.
    assert len(during) > 20 * (end - start)


def interrupt_after(seconds):
    timer = threading.Timer(seconds, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    return timer


def test_ctrl_c_ends_fits_at_once(scene):
    many = bc.render(scene, pose=[{}] * 400, photons=2000, seed=4, model="fast")
    fitter = bc.Fitter(scene, many)
    timer = interrupt_after(0.3)
    start = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        fitter.fit_each(many)
    assert time.monotonic() - start < 3  # all of them take much longer
    timer.join()
    # The fitter serves on.
    assert fitter.fit(many[0]).modes


def test_ctrl_c_at_any_moment_leaves_a_fitter_that_serves(scene):
    many = bc.render(scene, pose=[{}] * 40, photons=2000, seed=4, model="fast")
    expected = without_times(bc.Fitter(scene, many).fit(many[0]).to_dict())
    for moment in range(20):
        fitter = bc.Fitter(scene, many)
        timer = interrupt_after(0.01 + 0.005 * moment)
        with pytest.raises(KeyboardInterrupt):
            while True:
                fitter.fit_each(many)
        timer.join()
        assert without_times(fitter.fit(many[0]).to_dict()) == expected


def test_ctrl_c_leaves_fits_of_other_threads_alone(scene, several):
    many = bc.render(scene, pose=[{}] * 400, photons=2000, seed=4, model="fast")
    fitter = bc.Fitter(scene, many)
    found = []
    other = threading.Thread(target=lambda: found.extend(fitter.fit_each(several)))
    timer = interrupt_after(0.3)
    with pytest.raises(KeyboardInterrupt):
        other.start()
        fitter.fit_each(many)
    other.join()
    timer.join()
    assert len(found) == len(several) and not any(r.error for r in found)


def test_no_thread_limit_below_zero():
    with pytest.raises(bc.Error, match="accepted: 0 to 1024"):
        bc.set_threads(-1)

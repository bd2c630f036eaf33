# SPDX-License-Identifier: Apache-2.0
"""Two local workers; what happens when one of them, or the scheduler, is killed."""

import contextlib
import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time

import pytest

import blindcorner as bc
from conftest import without_times

distributed = pytest.importorskip("distributed", reason="Dask is not installed")
cluster = pytest.importorskip("blindcorner.cluster")

DRIVE = bc.bundled("robot_drive.json")
PERCEPTIONS = ("los", "oracle")


@pytest.fixture
def client():
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as local, \
            distributed.Client(local) as client:
        yield client


@pytest.fixture(scope="module")
def one_machine(program, tmp_path_factory):
    """The directory of `trials` on one machine, for a number of trials."""
    made = {}

    def run(n):
        if n not in made:
            made[n] = tmp_path_factory.mktemp(f"one_machine_{n}")
            program("trials", DRIVE, "-n", n, "--perception", ",".join(PERCEPTIONS), "-o", made[n])
        return made[n]

    return run


def assert_same_files(directory, other):
    for name in ("trials.csv", "trials.json"):
        assert (directory / name).read_bytes() == (other / name).read_bytes(), name

    def page(folder):
        # The table's last column is the mean run time of a drive on this machine.
        return re.sub(rb"<td>[0-9.]+</tr>", b"<td></tr>", (folder / "trials.html").read_bytes())

    assert page(directory) == page(other)


def journal_trials(directory):
    lines = (directory / "journal.csv").read_text().split("\n")[1:-1]  # but what is cut at its end
    return [tuple(line.split(",")[i] for i in (0, 2)) for line in lines]


def when(condition, act):
    """A thread that acts once, when the condition holds."""

    def watch():
        end = time.monotonic() + 60
        while time.monotonic() < end:
            if condition():
                act()
                return
            time.sleep(0.005)

    thread = threading.Thread(target=watch)
    thread.start()
    return thread


def journal_holds(directory, lines):
    def holds():
        with contextlib.suppress(OSError):
            return (directory / "journal.csv").read_bytes().count(b"\n") > lines
        return False

    return holds


def test_trials_are_those_of_one_machine(client, one_machine, tmp_path, capsys):
    summary = cluster.trials(DRIVE, 6, client, tmp_path, perceptions=PERCEPTIONS, chunk=2)
    assert_same_files(tmp_path, one_machine(6))
    assert sum(summary.trials.values()) == 12 and "los" in repr(summary)
    told = capsys.readouterr().err
    assert "dashboard http" in told and "12/12 trials" in told and "left" in told
    # A larger study holds the smaller one; other chunks, the same bytes.
    cluster.trials(DRIVE, 9, client, tmp_path, perceptions=PERCEPTIONS, chunk=5, progress=False)
    assert_same_files(tmp_path, one_machine(9))
    assert len(journal_trials(tmp_path)) == 18
    with pytest.raises(bc.Error, match="holds another study"):
        cluster.trials(DRIVE, 9, client, tmp_path, perceptions=PERCEPTIONS, seed=5, progress=False)


def test_a_worker_killed_in_the_middle_loses_nothing(client, one_machine, tmp_path):
    pids = client.run(os.getpid)
    killed = []

    def kill():
        killed.append(next(iter(pids.values())))
        os.kill(killed[0], signal.SIGKILL)

    watcher = when(journal_holds(tmp_path, 5), kill)
    cluster.trials(DRIVE, 60, client, tmp_path, perceptions=PERCEPTIONS, chunk=2)
    watcher.join()
    assert killed, "the trials ended before a worker was killed"
    assert killed[0] not in client.run(os.getpid).values()
    assert_same_files(tmp_path, one_machine(60))
    found = journal_trials(tmp_path)
    assert len(found) == len(set(found)) == 120  # nothing lost, nothing twice


def test_an_interrupted_run_goes_on_from_the_journal(client, one_machine, tmp_path):
    watcher = when(journal_holds(tmp_path, 5), lambda: os.kill(os.getpid(), signal.SIGINT))
    with pytest.raises(KeyboardInterrupt):
        cluster.trials(DRIVE, 60, client, tmp_path, perceptions=PERCEPTIONS, chunk=1)
    watcher.join()
    done = journal_trials(tmp_path)
    assert 5 <= len(done) < 120
    with (tmp_path / "journal.csv").open("a") as journal:
        journal.write("los,0,12")  # a torn line
    cluster.trials(DRIVE, 60, client, tmp_path, perceptions=PERCEPTIONS, progress=False)
    assert journal_trials(tmp_path)[:len(done)] == done
    assert_same_files(tmp_path, one_machine(60))


@contextlib.contextmanager
def processes():
    """A list of processes that end with it."""
    started = []
    try:
        yield started
    finally:
        for process in started:
            process.kill()
            process.wait()


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def test_a_scheduler_restarted_in_the_middle_loses_nothing(one_machine, tmp_path, capsys):
    port = free_port()
    address = f"tcp://127.0.0.1:{port}"

    def start(module, *arguments):
        return subprocess.Popen([sys.executable, "-m", f"distributed.cli.dask_{module}", *arguments],
                                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def start_both(started):
        started.append(start("scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"))
        for _ in range(2):
            started.append(start("worker", address, "--nthreads", "1", "--no-nanny", "--no-dashboard"))

    with processes() as started:
        start_both(started)
        with distributed.Client(address, timeout=30) as client:
            client.wait_for_workers(2, timeout=30)

            def restart():
                for process in list(started):
                    process.kill()
                    process.wait()
                start_both(started)

            watcher = when(journal_holds(tmp_path, 5), restart)
            cluster.trials(DRIVE, 60, client, tmp_path, perceptions=PERCEPTIONS, chunk=1)
            watcher.join()
    assert len(started) == 6
    assert "is gone" in capsys.readouterr().err
    assert_same_files(tmp_path, one_machine(60))
    found = journal_trials(tmp_path)
    assert len(found) == len(set(found)) == 120


def test_a_full_disk_ends_the_run_and_the_next_one_goes_on(client, one_machine, tmp_path):
    # A file that must not grow beyond some lines stands for a disk that is full.
    script = f"""
import resource, sys
import blindcorner as bc, blindcorner.cluster as cluster
from distributed import Client
with Client({client.scheduler.address!r}) as client:
    resource.setrlimit(resource.RLIMIT_FSIZE, (3000, 3000))
    try:
        cluster.trials({DRIVE!r}, 60, client, {str(tmp_path)!r}, perceptions={PERCEPTIONS!r}, chunk=1)
    except bc.Error as error:
        sys.exit(str(error))
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=120)
    assert done.returncode == 1 and "journal.csv: cannot be written" in done.stderr
    assert 1 < len(journal_trials(tmp_path)) < 100
    cluster.trials(DRIVE, 60, client, tmp_path, perceptions=PERCEPTIONS, progress=False)
    assert_same_files(tmp_path, one_machine(60))


def test_workers_that_see_another_file_are_told(client, tmp_path):
    drive = json.loads(open(DRIVE).read())
    scene = json.loads(open(os.path.join(os.path.dirname(DRIVE), drive["scene"])).read())
    drive["scene"] = "scene.json"
    (tmp_path / "meshes").symlink_to(os.path.join(os.path.dirname(DRIVE), "meshes"))
    (tmp_path / "scene.json").write_text(json.dumps(scene))
    (tmp_path / "drive.json").write_text(json.dumps(drive))
    from blindcorner.cluster import _trials

    request = (str(tmp_path / "drive.json"), 1, ("los",), 1, 0, 0.0, ())
    error = client.submit(_trials.run_chunk, 0, request, "another study", []).exception()
    assert isinstance(error, bc.Error) and "another drive or scene file" in str(error)


def test_fits_are_those_of_one_machine(client, scene, several, program, tmp_path):
    several.save(tmp_path / "several.exr")
    captures = bc.load_captures(tmp_path / "several.exr")
    results = cluster.fit(scene, captures, client, tmp_path / "here", chunk=2)
    program("fit", scene.path, tmp_path / "several.exr", "-o", tmp_path / "there", "--no-page")
    here = json.loads((tmp_path / "here" / "result.json").read_text())
    there = json.loads((tmp_path / "there" / "result.json").read_text())
    assert without_times(here) == without_times(there) == without_times(results.to_dict())
    # One by one, in the order in which they end: the same bytes but for run times.
    again = cluster.fit(scene, captures, client, chunk=1, progress=False)
    assert without_times(again.to_dict()) == without_times(here)


def test_fits_go_on_from_their_journal(client, scene, several, tmp_path):
    whole = cluster.fit(scene, several, client, tmp_path, progress=False)
    before = (tmp_path / "result.json").read_bytes()
    journal = tmp_path / "captures.jsonl"
    lines = journal.read_bytes().splitlines(keepends=True)
    assert len(lines) == len(several)
    # Two captures are there, a third one is torn.
    journal.write_bytes(b"".join(lines[:2]) + lines[2][:20])
    (tmp_path / "result.json").unlink()
    cluster.fit(scene, several, client, tmp_path, progress=False)
    assert journal.read_bytes().splitlines(keepends=True)[:2] == lines[:2]
    after = json.loads((tmp_path / "result.json").read_bytes())
    assert without_times(after) == without_times(json.loads(before)) == without_times(whole.to_dict())
    with pytest.raises(bc.Error, match="options differ"):
        cluster.fit(scene, several, client, tmp_path, seed=2, progress=False)


def test_sweep_fits_with_each_setting(client, scene, several, tmp_path):
    found = cluster.sweep(scene, several[:2], {"few": {"starts": 1}, "usual": {}}, client, tmp_path,
                          progress=False)
    assert list(found) == ["few", "usual"] and len(found["usual"]) == 2
    rows = (tmp_path / "sweep.csv").read_text().splitlines()
    assert rows[0].startswith("setting,captures,failed,median_error_m") and len(rows) == 3
    assert (tmp_path / "few" / "result.json").exists()
    with pytest.raises(bc.Error, match="accepted: names of folders"):
        cluster.sweep(scene, several, {"../x": {}}, client, tmp_path)


def run_command(*arguments):
    return subprocess.run([sys.executable, "-m", "blindcorner.cluster", *map(str, arguments)],
                          capture_output=True, text=True, timeout=180)


def test_command_line(one_machine, tmp_path):
    done = run_command("trials", DRIVE, "-n", 6, "-o", tmp_path, "--perception", ",".join(PERCEPTIONS),
                       "--workers", 2)
    assert done.returncode == 0, done.stderr
    assert "dashboard http" in done.stderr and "Trials in" in done.stdout
    assert_same_files(tmp_path, one_machine(6))


def test_command_line_errors_are_one_line(tmp_path):
    done = run_command("trials", tmp_path / "no.json", "-o", tmp_path / "out", "--workers", 1)
    assert done.returncode == 2 and "no.json" in done.stderr
    assert "Traceback" not in done.stderr
    done = run_command("trials", DRIVE, "-o", tmp_path / "out", "--slurm", "queue=x")
    assert done.returncode == 2 and "accepted: partition" in done.stderr

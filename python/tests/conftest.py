# SPDX-License-Identifier: Apache-2.0
"""What the tests share. BLINDCORNER_PROGRAM names the program that results are compared with."""

import json
import os
import subprocess

import pytest

import blindcorner as bc


@pytest.fixture(scope="session")
def program():
    """Runs the program; skips without one."""
    path = os.environ.get("BLINDCORNER_PROGRAM")
    if not path:
        pytest.skip("BLINDCORNER_PROGRAM names no program to compare with")

    def run(*arguments):
        done = subprocess.run([path, *map(str, arguments)], capture_output=True, text=True, timeout=300)
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


@pytest.fixture(scope="session")
def scene():
    return bc.Scene.load(bc.bundled("tmf8828_wall.json"))


@pytest.fixture(scope="session")
def capture():
    return bc.load_captures(bc.bundled("captures/tmf8828_wall.exr"))


@pytest.fixture(scope="session")
def several(scene):
    """Six captures, each at another pose, 2000 photons."""
    return bc.render(scene, random=6, photons=2000, seed=3, model="fast")


@pytest.fixture(scope="session")
def result(scene, capture):
    return bc.fit(scene, capture)


def without_times(document):
    """The fields of result.json but those that differ from run to run, or from build to build."""
    document = json.loads(json.dumps(document))
    assert document.pop("program").startswith(f"blindcorner {bc.__version__} (")
    for entry in document["captures"]:
        entry.pop("time_ms")
    return document

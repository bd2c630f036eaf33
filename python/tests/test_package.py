# SPDX-License-Identifier: Apache-2.0
import inspect
from pathlib import Path

import blindcorner as bc


def test_package_is_typed():
    folder = Path(bc.__file__).parent
    assert (folder / "py.typed").exists()
    stub = (folder / "_core.pyi").read_text()
    for name in ("class Fitter", "class Scene", "def render", "def plan"):
        assert name in stub


def test_everything_public_says_what_it_is():
    for name in bc.__all__:
        thing = getattr(bc, name)
        if name == "__version__":
            continue
        assert inspect.getdoc(thing), name
        for member, value in inspect.getmembers(thing if inspect.isclass(thing) else object):
            if not member.startswith("_") and isinstance(value, property):
                assert inspect.getdoc(value), f"{name}.{member}"

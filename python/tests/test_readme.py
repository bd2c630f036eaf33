# SPDX-License-Identifier: Apache-2.0
"""The first fit of README.md runs as it stands, and its answer holds the truth."""

import re
from pathlib import Path

import numpy as np

README = Path(__file__).parents[2] / "README.md"


def test_first_fit(capsys):
    blocks = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)
    assert len(blocks) == 1
    names = {}
    exec(compile(blocks[0], str(README), "exec"), names)
    said = capsys.readouterr().out
    assert "explain the light" in said or said.startswith("Found at")
    result, captures = names["result"], names["captures"]
    truth = np.array([captures.truth[0][name] for name in names["scene"].unknowns])
    off = (result.mean - truth)[:3]  # of the position; yaw is circular
    squared = off @ np.linalg.solve(result.covariance[:3, :3], off)
    assert squared < 16  # of three unknowns: exceeded by 1 of 1000

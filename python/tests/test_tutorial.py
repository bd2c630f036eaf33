# SPDX-License-Identifier: Apache-2.0
"""docs/tutorial.ipynb runs, and its answer holds the truth."""

import re
from pathlib import Path

import pytest

import blindcorner as bc

nbformat = pytest.importorskip("nbformat", reason="nbclient is not installed")
nbclient = pytest.importorskip("nbclient", reason="nbclient is not installed")

NOTEBOOK = Path(__file__).parents[2] / "docs" / "tutorial.ipynb"


def outputs(cell):
    """All that a cell shows, by MIME type."""
    shown = {"text/plain": ""}
    for output in cell.outputs:
        if output.output_type == "stream":
            shown["text/plain"] += output.text
        for kind, value in output.get("data", {}).items():
            shown[kind] = shown.get(kind, "") + value
    return shown


def test_tutorial(tmp_path):
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells), "it is kept without outputs"
    client = nbclient.NotebookClient(notebook, timeout=300, kernel_name="python3",
                                     resources={"metadata": {"path": str(tmp_path)}})
    client.execute()
    cells = [outputs(cell) for cell in notebook.cells if cell.cell_type == "code"]
    assert len(cells) == 10
    assert "Captures (" in cells[0]["text/plain"]
    for picture in (1, 3, 7, 8):
        assert "image/png" in cells[picture]
    assert "signal to noise" in cells[2]["text/plain"]
    assert "presence 1.000" in cells[5]["text/plain"]
    assert cells[6]["text/html"].startswith("<iframe")
    said = re.search(r"off by ([\d.]+) cm; 95 % of draws within ([\d.]+) cm", cells[9]["text/plain"])
    assert float(said[1]) < float(said[2])


def test_logs_are_those_of_the_text():
    empty = bc.import_captures(bc.bundled("logs/empty.log"), bin_width_ps=88)
    capture = bc.import_captures(bc.bundled("logs/object.log"), bin_width_ps=88)
    assert empty.counts.shape == (3, 9, 128) and capture.counts.shape == (1, 9, 128)
    assert (empty.counts.argmax(axis=2) == capture.counts.argmax(axis=2)).all()

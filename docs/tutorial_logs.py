# SPDX-License-Identifier: Apache-2.0
"""Writes the logs of the tutorial, scenes/logs/*.log: what a TMF8828's driver would print of the bundled
scene tmf8828_wall, simulated. Usage: python docs/tutorial_logs.py (needs the package blindcorner)."""

from pathlib import Path

import numpy as np

import blindcorner as bc

ADDRESS = 65  # on the I2C bus
scene = bc.Scene.load(Path(__file__).parent.parent / "scenes" / "tmf8828_wall.json")


def write(name: str, captures: bc.Captures) -> None:
    lines = []
    for counts in captures.counts:
        channels = np.vstack([counts[:1], counts]).astype(np.int64)  # channel 0 is the reference
        for significance in range(3):
            for channel, bins in enumerate(channels):
                values = ",".join(str(v) for v in bins >> (8 * significance) & 255)
                lines.append(f"#Raw,{ADDRESS},{10 * significance + channel},{values}")
    path = Path(scene.path).parent / "logs" / name
    path.write_text("\n".join(lines) + "\n")


write("empty.log", bc.render(scene, pose=[{}] * 3, empty=True, seed=11))
write("object.log", bc.render(scene, pose={"x_m": 0.28, "y_m": 0.5, "z_m": 1.05, "yaw_deg": -20}, seed=12))

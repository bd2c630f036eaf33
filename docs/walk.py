#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Numbers and picture of the recorded walk, from the result of
`blindcorner fit scenes/st_person_tracking.json st.exr -o out/walk`.

usage: docs/walk.py out/walk/result.json -o docs/images/walk.png   (needs numpy and matplotlib)
"""
import argparse
import json

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

# Floor marks (m, world x and y), in the order of a way around the rectangle.
MARKS = np.array([[-0.8, -0.66], [-1.4, -0.66], [-1.4, -1.25], [-0.8, -1.25]])


def outline_distance(points):
    """Distance of each point from the rectangle's outline, m."""
    center, half = MARKS.mean(0), np.ptp(MARKS, axis=0) / 2
    over = np.abs(points - center) - half
    outside = np.hypot(*np.maximum(over, 0).T)
    return np.abs(outside + np.minimum(over.max(1), 0))


def perimeter():
    t = np.linspace(0, 1, 200, endpoint=False)[:, None]
    return np.concatenate([MARKS[i] + (MARKS[(i + 1) % 4] - MARKS[i]) * t for i in range(4)])


def visits(points, window=5, reach=0.25):
    """Marks in the order in which a running median comes near them."""
    half = window // 2
    smooth = [np.median(points[max(0, i - half) : i + half + 1], 0) for i in range(len(points))]
    order = []
    for p in smooth:
        d = np.hypot(*(MARKS - p).T)
        if d.min() < reach and (not order or order[-1] != d.argmin()):
            order.append(int(d.argmin()))
    return order


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("result")
    parser.add_argument("-o", "--output", help="picture")
    arguments = parser.parse_args()
    with open(arguments.result) as file:
        captures = json.load(file)["captures"]
    points = np.array([c["modes"][0]["optimum"][:2] for c in captures])
    times = np.array([c["time_ms"]["total"] - c["time_ms"]["prepare"] for c in captures])
    distance = outline_distance(points)
    around = perimeter()
    gaps = np.hypot(*(around[:, None] - points[None]).transpose(2, 0, 1)).min(1)
    text = (
        f"median distance {100 * np.median(distance):.2f} cm, "
        f"{100 * np.mean(gaps < 0.1):.0f} % of the perimeter within 10 cm of a fit"
    )
    print(text)
    print("marks", " ".join(map(str, visits(points))))
    print(f"median {np.median(times):.1f} ms, mean {times.mean():.1f} ms, 90 % {np.quantile(times, 0.9):.1f} ms a frame")
    if not arguments.output:
        return
    figure, axes = plt.subplots(figsize=(7.2, 5.2), dpi=110)
    axes.axhline(0, color="#333840", lw=3)
    axes.annotate("relay wall", (-1.95, 0.02), color="#333840")
    axes.plot(0, -0.82, marker="<", ms=11, color="black")
    axes.annotate("sensor", (-0.02, -0.78), ha="center", va="bottom")
    axes.plot(*np.vstack([MARKS, MARKS[:1]]).T, color="#c03028", lw=1.5, label="floor marks")
    axes.plot(*points.T, color="#888", lw=0.5, alpha=0.6)
    dots = axes.scatter(*points.T, c=np.arange(len(points)), s=16, cmap="viridis", zorder=3)
    figure.colorbar(dots, label="frame")
    axes.set(xlabel="x (m)", ylabel="y (m)", aspect="equal", xlim=(-2, 0.15), ylim=(-1.8, 0.15))
    axes.set_title("A person walks around a rectangle: each frame fitted by itself", fontsize=11)
    axes.text(0.02, 0.02, text, transform=axes.transAxes, fontsize=8.5)
    axes.legend(loc="upper right", bbox_to_anchor=(1, 0.9), fontsize=9)
    figure.tight_layout()
    figure.savefig(arguments.output)


if __name__ == "__main__":
    main()

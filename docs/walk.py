#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Numbers and picture of the recorded walk, from the result of
`blindcorner fit scenes/st_person_tracking.json st.exr [--track] -o out/walk`.

usage: docs/walk.py out/walk/result.json [-o docs/images/walk.png]   (needs numpy; matplotlib for the picture)
       docs/walk.py --particles $BLINDCORNER_DATA/consumer_nlos/st_person_tracking

The second form judges the particle filter's own output, which the recording holds, in the same way.

One row of figures for each kind of estimate in the result: frames fitted by themselves, or the track's filter (a
frame and those before it) and its smoother (those after it as well). The truth is known only as far as this: the person
walks along the sides of the rectangle of floor marks and stands at its corners.
"""
import argparse
import json
from pathlib import Path

import numpy as np

# Floor marks (m, world x and y), in the order of a way around the rectangle.
MARKS = np.array([[-0.8, -0.66], [-1.4, -0.66], [-1.4, -1.25], [-0.8, -1.25]])
CHI2_95 = 5.991  # of two degrees of freedom


def nearest_on_outline(points):
    """The point of the rectangle's outline nearest to each point."""
    nearest = np.full_like(points, np.inf)
    best = np.full(len(points), np.inf)
    for a, b in zip(MARKS, np.roll(MARKS, -1, 0)):
        t = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        foot = a + t[:, None] * (b - a)
        distance = np.hypot(*(points - foot).T)
        closer = distance < best
        nearest[closer], best[closer] = foot[closer], distance[closer]
    return nearest


def perimeter():
    t = np.linspace(0, 1, 200, endpoint=False)[:, None]
    return np.concatenate([MARKS[i] + (MARKS[(i + 1) % 4] - MARKS[i]) * t for i in range(4)])


def visits(points, window=5, reach=0.25):
    """(mark, first frame, last frame + 1) in the order in which a running median comes near the marks."""
    half = window // 2
    smooth = [np.median(points[max(0, i - half) : i + half + 1], 0) for i in range(len(points))]
    order = []
    for i, p in enumerate(smooth):
        d = np.hypot(*(MARKS - p).T)
        if d.min() >= reach:
            continue
        if not order or order[-1][0] != d.argmin():
            order.append([int(d.argmin()), i, i + 1])
        order[-1][2] = i + 1
    return order


def estimates(captures):
    """name -> (frame numbers, points [n, 2], covariances [n, 2, 2])"""

    def collect(pose_of, covariance_of, use):
        numbers = [i for i, c in enumerate(captures) if use(c)]
        points = np.array([pose_of(captures[i])[:2] for i in numbers])
        covariances = np.array([np.array(covariance_of(captures[i]))[:2, :2] for i in numbers])
        return np.array(numbers), points, covariances

    heaviest = lambda c: c["modes"][0]
    if not any("track" in c for c in captures):
        return {
            "each frame by itself": collect(
                lambda c: heaviest(c)["optimum"], lambda c: heaviest(c)["covariance"], lambda c: c["modes"]
            )
        }
    smoothed = lambda c: c.get("track") and c["track"]["smoothed_pose"] is not None
    return {
        "track, filtered": collect(lambda c: heaviest(c)["pose"], lambda c: heaviest(c)["covariance"], lambda c: c["modes"]),
        "track, smoothed": collect(
            lambda c: c["track"]["smoothed_pose"], lambda c: c["track"]["smoothed_covariance"], smoothed
        ),
    }


def particle_means(folder):
    """[frames, 2] Mean of the particles of each frame of the recording, world x and y (m)."""
    files = sorted(Path(folder).glob("volume_*.npz"))
    if not files:
        raise SystemExit(f"walk.py: {folder}: found no volume_*.npz, accepted: the recording's folder")
    means = []
    for file in files:
        with np.load(file) as volume:
            x, _, z = volume["particles"].mean(axis=0)
        means.append((x, -z))
    return np.array(means)


def judge_particles(folder):
    points = particle_means(folder)
    distance = np.hypot(*(points - nearest_on_outline(points)).T)
    gaps = np.hypot(*(perimeter()[:, None] - points[None]).transpose(2, 0, 1)).min(1)
    print(f"== particle filter of the recording\n{'frames':>48}  {len(points)}")
    print(f"{'median distance to the rectangle, cm':>48}  {100 * np.median(distance):.3g}")
    print(f"{'perimeter within 10 cm':>48}  {np.mean(gaps < 0.1):.3g}")


def figures(numbers, points, covariances, interval):
    nearest = nearest_on_outline(points)
    offset = points - nearest
    distance = np.hypot(*offset.T)
    gaps = np.hypot(*(perimeter()[:, None] - points[None]).transpose(2, 0, 1)).min(1)
    seen = visits(points)
    approach = [np.hypot(*(points[a:b] - MARKS[m]).T).min() for m, a, b in seen]
    steps = np.hypot(*np.diff(points, axis=0).T) / np.diff(numbers)
    mahalanobis2 = np.einsum("ni,nij,nj->n", offset, np.linalg.inv(covariances), offset)
    order = [m for m, _, _ in seen]
    along_sides = all((a - b) % 4 in (1, 3) for a, b in zip(order, order[1:]))
    return {
        "frames": len(points),
        "median distance to the rectangle, cm": 100 * np.median(distance),
        "90 % quantile of it, cm": 100 * np.quantile(distance, 0.9),
        "perimeter within 10 cm": np.mean(gaps < 0.1),
        "marks visited": " ".join(map(str, order)) + ("" if along_sides else " (not along the sides)"),
        "closest approach in each visit, cm": " ".join(f"{100 * a:.1f}" for a in approach),
        "mean of it, cm": 100 * np.mean(approach),
        "largest step, m (m/s at %.3g s)" % interval: f"{steps.max():.3f} ({steps.max() / interval:.1f})",
        "95 % ellipse covers the rectangle": np.mean(mahalanobis2 < CHI2_95),
        "median semi-axes of a standard deviation, cm": " x ".join(
            f"{100 * a:.1f}" for a in np.sqrt(np.median(np.linalg.eigvalsh(covariances), 0))[::-1]
        ),
    }


def draw(path, sets, tracked):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.patches import Ellipse

    figure, all_axes = plt.subplots(
        1, len(sets), figsize=(0.8 + 6.4 * len(sets), 5.2), dpi=110, squeeze=False, sharey=True
    )
    for axes, (name, (numbers, points, covariances)) in zip(all_axes[0], sets.items()):
        axes.axhline(0, color="#333840", lw=3)
        axes.annotate("relay wall", (-1.95, 0.02), color="#333840")
        axes.plot(0, -0.82, marker="<", ms=11, color="black")
        axes.annotate("sensor", (-0.02, -0.78), ha="center", va="bottom")
        axes.plot(*np.vstack([MARKS, MARKS[:1]]).T, color="#c03028", lw=1.5, label="floor marks")
        axes.plot(*points.T, color="#888", lw=0.5, alpha=0.6)
        for k in range(0, len(points), 15 if tracked else len(points)):
            values, vectors = np.linalg.eigh(covariances[k])
            if tracked:
                axes.add_patch(
                    Ellipse(points[k], *(2 * np.sqrt(CHI2_95 * values)), fill=False, color="#777", lw=0.6,
                            angle=np.degrees(np.arctan2(*vectors[::-1, 0])))
                )
        dots = axes.scatter(*points.T, c=numbers, s=16, cmap="viridis", zorder=3)
        axes.set(xlabel="x (m)", aspect="equal", xlim=(-2, 0.15), ylim=(-1.8, 0.15))
        axes.set_title(name, fontsize=11)
        distance = np.hypot(*(points - nearest_on_outline(points)).T)
        axes.text(0.02, 0.02, f"median distance {100 * np.median(distance):.1f} cm", transform=axes.transAxes, fontsize=8.5)
        axes.legend(loc="upper right", bbox_to_anchor=(1, 0.9), fontsize=9)
    all_axes[0, 0].set_ylabel("y (m)")
    figure.colorbar(dots, ax=all_axes[0].tolist(), label="frame", shrink=0.9)
    figure.savefig(path, bbox_inches="tight")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("result", nargs="?")
    parser.add_argument("--particles", metavar="FOLDER", help="of the recording")
    parser.add_argument("-o", "--output", help="picture")
    arguments = parser.parse_args()
    if arguments.particles:
        return judge_particles(arguments.particles)
    if not arguments.result:
        parser.error("found neither a result nor --particles, accepted: one of them")
    with open(arguments.result) as file:
        captures = json.load(file)["captures"]
    times = np.array([c["time_ms"]["total"] for c in captures[1:]])
    tracked = any("track" in c for c in captures)
    clock = [c["track"]["time_s"] for c in captures if c.get("track")]
    interval = np.median(np.diff(clock)) if len(clock) > 1 else 0.05
    sets = estimates(captures)
    for name, (numbers, points, covariances) in sets.items():
        print(f"== {name}")
        for key, value in figures(numbers, points, covariances, interval).items():
            print(f"{key:>48}  {value:.3g}" if isinstance(value, float) else f"{key:>48}  {value}")
    print(
        f"a frame: median {np.median(times):.1f} ms, mean {times.mean():.1f} ms, "
        f"90 % {np.quantile(times, 0.9):.1f} ms, longest {times.max():.0f} ms; {1000 / times.mean():.0f} frames/s"
    )
    if arguments.output:
        draw(arguments.output, sets, tracked)


if __name__ == "__main__":
    main()

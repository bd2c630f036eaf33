#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Measures `blindcorner live`: latency, memory, and what browsers and damaged lines cost it.

usage: tests/live_study.py PROGRAM [--only latency|disturbances|cuts|memory] [--frames N] [--memory-frames N]
                           [--cut-seconds N] [--browsers N] [--quick] [--json FILE]

Frames are rendered by the program, printed as each sensor prints them (`replay --stdout --pace 0`) and
sent by this script at the sensor's rate through a pipe, so that it knows when the last byte of each
frame left. Latency is from there to the moment at which the answer's line has come back through
standard output, or as a server-sent event through the page's port. Python's standard library only.
Exit code 1 where a requirement is not met; with --quick, where something does not work at all.
"""
import argparse
import contextlib
import json
import os
import random
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

SOURCE = Path(__file__).resolve().parent.parent

WALL = {
    "surfaces": [
        {"name": "wall", "shape": "rectangle", "center_m": [0.8, 0.5, 1.25], "normal": [-1, 0, 0],
         "width_m": 4, "height_m": 2.5, "albedo": 0.7, "relay": True},
        {"name": "partition", "shape": "box", "base_m": [-0.57, 0.315, 0], "size_m": [1.9, 0.03, 2.2],
         "albedo": 0.5, "occluder": True},
    ],
    "sensor_pose": {"position_m": [0, 0, 1], "look": [1, 0, 0]},
    "hidden": {"name": "person", "shape": "cylinder", "radius_m": 0.25, "height_m": 1.75, "anchor": "base",
               "material": "lambertian", "albedo": 0.5, "position_m": [0.2, 1, 0]},
    "unknowns": {"x_m": [-0.3, 0.4], "y_m": [0.7, 1.4]},
}


LAP_S = 4  # around the search region, 1.7 m: a slow walk


class Case:
    """A sensor in front of the wall of scenes/person_vl53l8ch.json, and how many frames it sends in a second."""

    def __init__(self, name, preset, rate, ambient, gain=None, empty=False):
        self.name, self.rate, self.empty = name, rate, empty
        self.lap = int(LAP_S * rate)  # different frames, played in a circle
        sensor = {"preset": preset}
        if gain:
            sensor["gain"] = gain
        self.scene = {
            "name": name.replace(" ", "_"), "sensor": sensor, **WALL,
            "linear": {"amplitude": {"mode": "shared", "prior": {"median": 1, "sigma_log": 1}},
                       "ambient": ambient, "direct": {"mode": "per_zone"}},
            "motion": {"frame_interval_s": 1 / rate, "acceleration_density_m2_per_s3": 0.5},
        }


PHOTONS = {"mode": "per_zone", "counts_per_bin": 100}
CASES = [
    Case("TMF8828 3x3, 5 Hz", "tmf8828_3x3_long", 5, PHOTONS),
    Case("TMF8828 3x3, 30 Hz", "tmf8828_3x3_long", 30, PHOTONS),
    Case("VL53L8CH 4x4, 20 Hz", "vl53l8ch_4x4", 20, {"mode": "fixed", "counts_per_bin": 0}),
    Case("TMF8829 16x16, 10 Hz", "tmf8829_16x16", 10, PHOTONS, gain=1e8),
    Case("the same, nobody there", "tmf8829_16x16", 10, PHOTONS, gain=1e8, empty=True),
]


def check(command, **options):
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, **options)
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(map(str, command))}\n{done.stderr}")
    return done.stdout


def walk(frames):
    """Poses along a lap of the search region."""
    from math import cos, pi, sin

    return [f"x_m={0.05 + 0.25 * cos(2 * pi * i / frames):.3f},y_m={1.05 + 0.28 * sin(2 * pi * i / frames):.3f}"
            for i in range(frames)]


def frames_of(program, case, folder):
    """Scene file and the text of each frame of a lap."""
    lap = case.lap
    scene = folder / f"{case.scene['name'].replace(',', '')}.json"
    scene.write_text(json.dumps(case.scene))
    captures = scene.with_suffix(".exr")
    poses = [word for pose in walk(lap) for word in ("--pose", pose)]
    what = ["--empty", "--frames", str(lap)] if case.empty else poses
    check([program, "render", scene, *what, "--model", "fast", "--seed", "1", "-o", captures])
    text = check([program, "replay", captures, "--stdout", "--pace", "0"])
    lines = text.splitlines(keepends=True)
    each = len(lines) // lap
    return scene, ["".join(lines[i * each:(i + 1) * each]).encode() for i in range(lap)]


class Live:
    """A running `blindcorner live` with its answers as they come: `answers` maps a frame's number to (time, line)."""

    def __init__(self, program, scene, *options, address="-"):
        self.process = subprocess.Popen(
            [str(program), "live", str(scene), "--input", address, "--port", "0", *options],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, bufsize=0)
        self.answers, self.messages, self.port = {}, [], None
        self.threads = [threading.Thread(target=self._read_answers), threading.Thread(target=self._read_messages)]
        for thread in self.threads:
            thread.start()
        if "--no-page" not in options:
            wait_for(lambda: self.port is not None, "the page's address")

    def _read_answers(self):
        out = self.process.stdout
        buffer = b""
        while chunk := os.read(out.fileno(), 1 << 16):
            now = time.monotonic()
            buffer += chunk
            *lines, buffer = buffer.split(b"\n")
            for line in lines:
                answer = json.loads(line)
                if "frame" in answer:
                    self.answers[answer["frame"]] = (now, answer["skipped"], answer["presence_probability"],
                                                      answer["latency_ms"])

    def _read_messages(self):
        for line in self.process.stderr:
            text = line.decode().strip()
            self.messages.append(text)
            if "page: http://" in text:
                self.port = int(text.split("page: http://")[1].split("/")[0].rsplit(":", 1)[1])

    def send(self, data):
        view = memoryview(data)
        while view:
            view = view[self.process.stdin.write(view):]
        return time.monotonic()

    def memory_kb(self):
        status = Path(f"/proc/{self.process.pid}/status").read_text()
        return int(status.split("VmRSS:")[1].split()[0])

    def end(self):
        self.process.stdin.close()
        try:
            code = self.process.wait(timeout=30)
        except subprocess.TimeoutExpired:
            self.process.kill()
            raise SystemExit("live did not end with its input:\n" + "\n".join(self.messages))
        for thread in self.threads:
            thread.join()
        return code

    def counts(self):
        for text in reversed(self.messages):
            if "ended: " in text:
                parts = text.split("ended: ")[1].split(", ")
                return {part.split()[0]: int(part.split()[1]) for part in parts if part}
        raise SystemExit("live said no counts:\n" + "\n".join(self.messages))


def wait_for(condition, what, seconds=60):
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            raise SystemExit(f"{what} did not come within {seconds} s")
        time.sleep(0.01)


class Browser(threading.Thread):
    """Reads the page's events and notes when each frame's answer came; `deaf`: asks and never reads."""

    def __init__(self, port, deaf=False):
        super().__init__(daemon=True)
        self.came, self.deaf, self.ending = {}, deaf, False
        self.socket = socket.create_connection(("127.0.0.1", port))
        self.socket.sendall(f"GET /events HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
        self.start()

    def run(self):
        buffer = b""
        while self.deaf and not self.ending:
            time.sleep(0.1)
        with contextlib.suppress(OSError):
            while not self.ending and (chunk := self.socket.recv(1 << 16)):
                now = time.monotonic()
                buffer += chunk
                *events, buffer = buffer.split(b"\n\n")
                for event in events:
                    if b"event: answer" in event:
                        at = event.index(b'"frame":') + 8
                        self.came[int(event[at:at + 12].split(b",")[0].split(b"}")[0])] = now
        with contextlib.suppress(OSError):
            self.socket.close()


class Rubbish(threading.Thread):
    """A client that connects and sends what is no request, over and over."""

    def __init__(self, port):
        super().__init__(daemon=True)
        self.port, self.ending, self.sent = port, False, 0
        self.start()

    def run(self):
        rubbish = random.Random(5)
        while not self.ending:
            with contextlib.suppress(OSError):
                with socket.create_connection(("127.0.0.1", self.port), timeout=1) as connection:
                    connection.settimeout(0.2)
                    connection.sendall(rubbish.randbytes(rubbish.randrange(1, 3000)) + b"\r\n\r\n")
                    self.sent += 1
                    with contextlib.suppress(OSError):
                        connection.recv(1000)
            time.sleep(0.05)


def summary(latencies):
    """Median, 90 % and longest, ms."""
    ordered = sorted(1e3 * value for value in latencies)
    return {"answers": len(ordered), "median_ms": statistics.median(ordered),
            "p90_ms": ordered[int(0.9 * (len(ordered) - 1))], "longest_ms": ordered[-1]}


def play(live, frames, count, rate):
    """Sends frames at a rate; returns when the last byte of each was sent, by its number."""
    sent = {}
    begin = time.monotonic()
    for i in range(count):
        pause = begin + i / rate - time.monotonic()
        if pause > 0:
            time.sleep(pause)
        sent[i] = live.send(frames[i % len(frames)])
    return sent


def latencies_of(program, case, scene, frames, count, browsers=0, deaf=0, rubbish=0):
    """Latency on standard output and on the page of a run. The first two seconds prepare and are not counted."""
    live = Live(program, scene)
    others = [Browser(live.port) for _ in range(max(browsers, 1))] + [Browser(live.port, True) for _ in range(deaf)]
    noise = [Rubbish(live.port) for _ in range(rubbish)]
    warm = max(1, int(2 * case.rate))
    sent = play(live, frames, warm + count, case.rate)
    time.sleep(0.5)
    for other in others + noise:
        other.ending = True
    code = live.end()
    if code != 0:
        raise SystemExit(f"live ended with {code}:\n" + "\n".join(live.messages))
    out = [live.answers[n][0] - t for n, t in sent.items() if n >= warm and n in live.answers]
    page = [others[0].came[n] - t for n, t in sent.items() if n >= warm and n in others[0].came]
    counts = live.counts()
    return {"stdout": summary(out), "page": summary(page), "skipped": counts.get("skipped_frames", 0),
            "counts": counts}


def study_latency(program, folder, arguments):
    rows = []
    for case in CASES:
        scene, frames = frames_of(program, case, folder)
        run = latencies_of(program, case, scene, frames, arguments.frames)
        rows.append({"case": case.name, "frame_ms": 1e3 / case.rate, **run})
        for where in ("stdout", "page"):
            s = run[where]
            print(f"{case.name:22} {where:7} {s['answers']:6} answers  median {s['median_ms']:6.1f}  "
                  f"90 % {s['p90_ms']:6.1f}  longest {s['longest_ms']:7.1f} ms of {1e3 / case.rate:.0f}  "
                  f"skipped {run['skipped']}", flush=True)
    return rows


def study_disturbances(program, folder, arguments):
    """The same run alone and among browsers that read, that do not, and rubbish."""
    case = CASES[2]
    scene, frames = frames_of(program, case, folder)
    rows = []
    for name, options in [("alone", {}), ("browsers", {"browsers": arguments.browsers}),
                          ("deaf browser", {"deaf": 1}), ("rubbish", {"rubbish": 2}), ("alone again", {})]:
        run = latencies_of(program, case, scene, frames, arguments.frames, **options)
        rows.append({"case": name, **run})
        s = run["stdout"]
        print(f"{name:22} stdout  {s['answers']:6} answers  median {s['median_ms']:6.1f}  90 % {s['p90_ms']:6.1f}  "
              f"longest {s['longest_ms']:7.1f} ms  skipped {run['skipped']}", flush=True)
    return rows


class Cable:
    """A TCP port that sends a sensor's frames, and damages some of them in one of four ways."""

    KINDS = {"cut": 4, "corrupt": 4, "repeated": 4, "closed": 1}  # with these weights

    def __init__(self, seed):
        self.chance, self.damaged = random.Random(seed), dict.fromkeys(self.KINDS, 0)
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.listener.settimeout(30)
        self.address = f"tcp://127.0.0.1:{self.listener.getsockname()[1]}"
        self.peer, self.sent = None, 0

    def connect(self):
        if self.peer is None:
            self.peer = self.listener.accept()[0]
            self.peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def close(self):
        self.peer.close()
        self.peer = None

    def send(self, frame, share):
        """A frame, which is damaged with the probability `share`."""
        kind = None
        if self.chance.random() < share:
            kind = self.chance.choices(list(self.KINDS), self.KINDS.values())[0]
            frame = getattr(self, "_" + kind)(frame)
            self.damaged[kind] += 1
        self.connect()
        self.peer.sendall(frame)
        self.sent += 1
        if kind == "closed":
            self.close()

    def _cut(self, frame):
        at = self.chance.randrange(len(frame))
        return frame[:at] + frame[at + self.chance.randrange(1, 400):]

    def _corrupt(self, frame):
        at, length = self.chance.randrange(len(frame)), self.chance.randrange(1, 40)
        return frame[:at] + self.chance.randbytes(length) + frame[at + length:]

    def _repeated(self, frame):
        lines = frame.splitlines(keepends=True)
        at = self.chance.randrange(len(lines))
        return b"".join(lines[:at + 1] + [lines[at]] * self.chance.randrange(1, 4) + lines[at + 1:])

    def _closed(self, frame):
        return frame[:self.chance.randrange(len(frame))]


def send_for(cable, frames, rate, seconds, share):
    """Frames at a rate; what a closed connection holds up is not made up for. Returns how many."""
    begun = due = time.monotonic()
    count = 0
    while due - begun < seconds:
        pause = due - time.monotonic()
        if pause > 0:
            time.sleep(pause)
        elif pause < -1 / rate:
            due -= pause
        cable.send(frames[count % len(frames)], share)
        count, due = count + 1, due + 1 / rate
    return count


def study_cuts(program, folder, arguments):
    """Latency before, during and after a time in which one frame in ten is damaged or the connection is closed."""
    case = CASES[1]
    scene, frames = frames_of(program, case, folder)
    cable = Cable(9)
    live = Live(program, scene, "--no-page", address=cable.address)
    around = max(1, min(120, arguments.cut_seconds / 10))
    send_for(cable, frames, case.rate, 2, 0)  # prepares
    rows = []
    for name, seconds, share in [("before", around, 0), ("during", arguments.cut_seconds, 0.1), ("after", around, 0)]:
        begun, load = set(live.answers), os.getloadavg()[0]
        sent = send_for(cable, frames, case.rate, seconds, share)
        time.sleep(0.5)
        said = [answer[3] / 1e3 for frame, answer in list(live.answers.items()) if frame not in begun]
        rows.append({"case": name, "seconds": seconds, "frames": sent, "load": [load, os.getloadavg()[0]],
                     "memory_kb": live.memory_kb(), **summary(said)})
        s = rows[-1]
        print(f"cuts, {name:6}  {sent:6} frames sent  {s['answers']:6} answers  median {s['median_ms']:5.1f}  "
              f"90 % {s['p90_ms']:5.1f}  longest {s['longest_ms']:6.1f} ms of {1e3 / case.rate:.0f}  "
              f"{s['memory_kb'] / 1024:.1f} MiB  load {load:.1f} to {s['load'][1]:.1f}", flush=True)
    live.process.send_signal(signal.SIGINT)
    code, counts = live.end(), live.counts()
    print("cuts, damaged:", ", ".join(f"{name} {count}" for name, count in cable.damaged.items()),
          "- counted:", ", ".join(f"{name} {count}" for name, count in counts.items()), flush=True)
    # A cut over the end of a frame costs the next one too; so may a closed connection.
    touched = sum(cable.damaged.values())
    met = code == 0 and counts["frames"] >= cable.sent - 2 * touched
    return {"rows": rows, "damaged": cable.damaged, "counts": counts, "exit_code": code, "sent": cable.sent, "met": met}


def study_memory(program, folder, arguments):
    """Resident memory after more and more frames, as fast as they are taken, every one fitted."""
    case = CASES[0]
    scene, frames = frames_of(program, case, folder)
    live = Live(program, scene, "--no-page", "--every-frame")
    marks = [n for n in (100, 1000, 3000, 10_000, 30_000, 100_000) if n <= arguments.memory_frames]
    rows, begun = [], time.monotonic()
    for i in range(marks[-1]):
        live.send(frames[i % len(frames)])
        if i + 1 in marks:
            wait_for(lambda: len(live.answers) >= i - 2, f"the answer to frame {i}", 600)
            rows.append({"frames": i + 1, "fitted": len(live.answers), "memory_kb": live.memory_kb(),
                         "seconds": time.monotonic() - begun})
            print(f"memory after {i + 1:7} frames  {rows[-1]['memory_kb'] / 1024:.1f} MiB  "
                  f"({rows[-1]['fitted']} answers, {rows[-1]['seconds']:.0f} s)", flush=True)
    live.end()
    counts = live.counts()
    print(f"memory, counted: {counts}", flush=True)
    rows[-1]["fitted"] = counts["answers"] - counts.get("failed_frames", 0)
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("program")
    parser.add_argument("--frames", type=int, default=1000, help="of each sensor")
    parser.add_argument("--memory-frames", type=int, default=100_000)
    parser.add_argument("--cut-seconds", type=float, default=60, help="in which frames are damaged")
    parser.add_argument("--browsers", type=int, default=50)
    parser.add_argument("--only", choices=["latency", "disturbances", "cuts", "memory"], action="append")
    parser.add_argument("--quick", action="store_true", help="few frames: whether it works, not how fast")
    parser.add_argument("--json", help="file for the figures")
    arguments = parser.parse_args()
    if arguments.quick:
        arguments.frames, arguments.memory_frames, arguments.browsers, arguments.cut_seconds = 20, 100, 5, 3
    program = Path(arguments.program).resolve()
    studies = {"latency": study_latency, "disturbances": study_disturbances, "cuts": study_cuts,
               "memory": study_memory}
    figures, missed = {}, []
    with tempfile.TemporaryDirectory() as folder:
        for name in arguments.only or studies:
            figures[name] = studies[name](program, Path(folder), arguments)
    for row in figures.get("latency", []):
        for where in ("stdout", "page"):
            if row[where]["answers"] == 0:
                missed.append(f"{row['case']}: no answer on {where}")
            elif not arguments.quick and row[where]["p90_ms"] >= row["frame_ms"]:
                missed.append(f"{row['case']}: 90 % on {where} is not below one frame time")
    if "cuts" in figures and not figures["cuts"]["met"]:
        missed.append("random cuts cost more than the frames that they hit")
    memory = figures.get("memory", [])
    if len(memory) > 2 and memory[-1]["memory_kb"] > 1.1 * memory[1]["memory_kb"]:
        missed.append("memory grows by more than a tenth after the first thousand frames")
    if arguments.json:
        Path(arguments.json).write_text(json.dumps(figures, indent=1) + "\n")
    for text in missed:
        print("MISSED: " + text)
    sys.exit(1 if missed else 0)


if __name__ == "__main__":
    main()

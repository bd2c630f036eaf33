# SPDX-License-Identifier: Apache-2.0
"""Bundled files and what the program writes suit their JSON schemas; what readers refuse for its form,
schemas refuse as well.

validate.py SOURCE PROGRAM UNIT_TESTS; prints SKIPPED without jsonschema (Debian: python3-jsonschema).
"""

import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

try:
    import jsonschema
except ImportError:
    print("SKIPPED: there is no jsonschema (Debian: python3-jsonschema)")
    sys.exit(0)

SOURCE, PROGRAM, UNIT_TESTS = map(Path, sys.argv[1:4])
SCHEMAS = {kind: json.loads((SOURCE / f"schema/{kind}.schema.json").read_text())
           for kind in ("scene", "drive", "capture", "instrument", "result")}
# Unit tests whose wrong files are kept.
WRONG_FILES = "SceneFile.*MistakesAreTold*:DriveFile.WrongOnes*:CaptureFileTest.WrongMetadata*"

# What schemas accept and readers refuse, as the messages begin.
ONLY_THE_READER = [
    # What a parser has lost.
    "exposures: found twice in one object",
    # What other numbers of the same file decide: sizes, bounds, order, sums.
    "captures[0].relay_points_m: found an array of 1",
    "captures[0].relay_points_m[0][0]: found null",
    "sensor.time_zero_ps: found an array of 3",
    "sensor.wrap_bins: found 65",
    "sensor.valid_bins[1]: found 64",
    "sensor.valid_bins[1]: found 4",
    "sensor.valid_bins: found an array of 1",
    "sensor.dead_zones[0]: found 2",
    "sensor.background_counts: found an array of 1",
    "sensor.background_counts[0]: found an array of 2",
    "sensor.noise.variance_floor: found an array of 1",
    "sensor.zones: found an array of 1",
    "sensor.zones[1]: found another kind of footprint than zones[0]",
    "sensor.zones[1].angles_deg.top: found 2",
    "sensor.zone_columns_deg[1]: found [1,0]",
    "sensor.illumination.field.left_deg: found 5",
    "sensor.impulse_response.tails: found",
    "sensor.impulse_response.times_ps[2]: found 5",
    "sensor.impulse_response.values: found [0,0]",
    "surfaces: found no surface with",
    "surfaces[0].albedo: found 0",
    "hidden.position_m: found nothing",
    "hidden.position_m[2]: found null",
    "hidden.position_m[0]: found 0.6",
    "unknowns.x_m: found [1,1]",
    "unknowns.yaw_deg: found [0,361]",
    "speed_m_per_s: found [3,2]",
    "sensor.faults.late_by_s: found nothing",
    # Geometry.
    "captures[0].sensor_pose.quaternion_wxyz: found [0.5,0,0,0]",
    "sensor_pose.quaternion_wxyz: found [1,1,0,0]",
    "sensor_pose.look: found [0,0,0]",
    "sensor_pose.up: found [2,0,0]",
    "surfaces[0].normal: found [0,0,0]",
    "vehicle.start.position_m: found [9,9]",
    "route_m[0]: found [0.5,40]",
    "finish_line_m[1]: found",
    "map.upper_m: found [-3,4]",
    "map.cell_m: found 0.001",
    "lane.upper_m: found [-1,1]",
    # What another file holds.
    'scene: found "none.json"',
    "hidden.x_m: found 7",
    "hidden.z_m: found an unknown field",
]


def problems(kind, document):
    """What a schema finds, a line each."""
    validator = jsonschema.Draft7Validator(SCHEMAS[kind])
    return [f"{e.json_path}: {e.message}" for e in validator.iter_errors(document)]


def bundled():
    """(kind, path) of all files that come with the program."""
    for path in sorted((SOURCE / "scenes").glob("*.json")):
        yield ("drive" if path.stem.endswith("_drive") else "scene"), path
    for kind in ("scene", "drive", "instrument"):
        for path in sorted((SOURCE / "tests/fuzz/corpus" / kind).glob("*.json")):
            yield kind, path


def written(folder):
    """(kind, path) of files that the program writes."""
    def run(*arguments):
        subprocess.run([PROGRAM, *arguments], cwd=folder, check=True, stdout=subprocess.DEVNULL,
                       stderr=subprocess.DEVNULL)

    wall = SOURCE / "scenes/tmf8828_wall.json"
    run("init", "--sensor", "vl53l8ch_4x4", "-o", "desk.json")
    run("render", "desk.json", "--model", "fast", "--random", "3", "--photons", "5000", "-o", "c.exr")
    run("fit", "desk.json", "c.exr", "-o", "each", "--no-page")
    run("fit", "desk.json", "c.exr", "-o", "joint", "--no-page", "--joint")
    run("fit", "desk.json", "c.exr", "-o", "track", "--no-page", "--track")
    run("render", wall, "--model", "fast", "--empty", "--random", "4", "-o", "none.exr")
    run("calibrate", wall, "none.exr", "--no-object", "-o", "instrument.json", "--no-page")
    yield "scene", folder / "desk.json"
    for kind in ("each", "joint", "track"):
        yield "result", folder / kind / "result.json"
    yield "instrument", folder / "instrument.json"
    bytes_ = (folder / "c.exr").read_bytes()  # the attribute's text is one line of JSON
    text = bytes_[bytes_.index(b'{"format":"blindcorner.capture/1"'):]
    (folder / "c.json").write_text(json.dumps(json.JSONDecoder().raw_decode(text.decode("latin-1"))[0]))
    yield "capture", folder / "c.json"


def refused(folder):
    """(kind, document, message) of what readers refuse; what is not JSON is left out."""
    subprocess.run([UNIT_TESTS, f"--gtest_filter={WRONG_FILES}"], check=True, stdout=subprocess.DEVNULL,
                   env=os.environ | {"BLINDCORNER_REFUSED": str(folder)})
    for path in sorted(folder.glob("*.json")):
        message = path.with_suffix(".txt").read_text()
        # Without the file's name.
        message = re.sub(r"^\S*(test\.json|m\.exr: attribute blindcorner)(: )?", "", message)
        try:
            yield path.stem.split("_")[0], json.loads(path.read_text()), message
        except json.JSONDecodeError:
            pass


def main():
    wrong = []
    with tempfile.TemporaryDirectory() as name:
        for files in (bundled(), written(Path(name))):
            for kind, path in files:
                document = json.loads(path.read_text())
                wrong += [f"{path}: {problem}" for problem in problems(kind, document)]
                schema = document.get("$schema")
                if path.parent.name == "scenes" or path.name == "desk.json":
                    if schema is None or json.loads((path.parent / schema).read_text()) != SCHEMAS[kind]:
                        wrong.append(f"{path}: names no schema of its kind")
    count, unused = 0, set(ONLY_THE_READER)
    with tempfile.TemporaryDirectory() as name:
        for kind, document, message in refused(Path(name)):
            count += 1
            known = [start for start in ONLY_THE_READER if message.startswith(start)]
            accepted = not problems(kind, document)
            if accepted and not known:
                wrong.append(f"{kind} schema accepts what its reader refuses: {message}")
            if accepted:
                unused -= set(known)
    wrong += [f"the schema refuses it as well, take it off the list: {start}" for start in sorted(unused)]
    if count < 100:
        wrong.append(f"only {count} refused files were found")
    print("\n".join(wrong) if wrong else f"all files are valid; {count} refused ones are as expected")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())

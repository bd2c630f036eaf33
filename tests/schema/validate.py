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

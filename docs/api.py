#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes docs/api.md, the list of public headers, from what each header says of itself.

    docs/api.py            writes docs/api.md
    docs/api.py --check    exit code 1 where docs/api.md is not what the headers say

A header begins with the licence line and then a comment of `///` that says what it holds.
"""
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
HEADERS = ROOT / "include/blindcorner"
FOLDERS = {
    "forward": "From a pose to the expected histogram",
    "inverse": "From a histogram to the pose",
    "planner": "Maps, paths, vehicles",
    "io": "Files",
    "simulation": "Synthetic captures, drives, studies",
    "report": "Results and pages",
}
BEGIN = """# Public headers

The list names every header that `cmake --install` installs, with the first sentence of what it says of itself. `docs/api.py`
writes this page. [library.md](library.md) says how to use the library.
"""


def first_sentence(path):
    """The first sentence of a header's comment."""
    words = []
    for line in path.read_text(encoding="utf-8").splitlines():
        if line.startswith("///"):
            words.append(line[3:].strip())
        elif words:
            break
    text = " ".join(words)
    found = re.match(r".*?[.:](?= [A-Z`(]|$)", text)
    sentence = (found[0] if found else text).rstrip(":.")
    return sentence.replace("|", "\\|") + "."


def classes(path):
    """Names of the classes, structs and free functions that a reader looks for: types only."""
    text = path.read_text(encoding="utf-8")
    names = re.findall(r"^(?:class|struct|enum class) (\w+)(?=[ :{])(?!.*;)", text, re.MULTILINE)
    return ", ".join(f"`{name}`" for name in names)


def page():
    parts = [BEGIN]
    for folder, title in FOLDERS.items():
        parts.append(f"\n## {title}\n\n| header `blindcorner/` | what it holds | types |\n|---|---|---|\n")
        for path in sorted((HEADERS / folder).rglob("*.h")):
            name = path.relative_to(HEADERS)
            parts.append(f"| [`{name}`](../include/blindcorner/{name}) | {first_sentence(path)} | {classes(path)} |\n")
    return "".join(parts)


def main():
    left_out = {path.name for path in HEADERS.iterdir()} - set(FOLDERS)
    if left_out:
        sys.exit(f"docs/api.py: include/blindcorner: found {', '.join(sorted(left_out))}, accepted: the folders {', '.join(FOLDERS)}")
    target = ROOT / "docs/api.md"
    if sys.argv[1:] == ["--check"]:
        if not target.exists() or target.read_text(encoding="utf-8") != page():
            sys.exit("docs/api.md is not what the headers say (docs/api.py writes it)")
    elif sys.argv[1:]:
        sys.exit(__doc__)
    else:
        target.write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()

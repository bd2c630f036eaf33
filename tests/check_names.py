#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Fails where two files define a type of the same name in namespace blindcorner.

The linker takes two such types for one and keeps one of their destructors (the one definition rule,
[basic.def.odr]); no compiler says so. Types inside other types and in unnamed namespaces do not count.
"""

import collections
import pathlib
import re
import sys

TYPE = re.compile(r"(?:struct|class) (\w+)(?: final)?(?: :[^;{]*)? ?\{")


def types(text: str) -> list[str]:
    """Names of the types that stand at the beginning of a line, outside unnamed namespaces."""
    named = re.sub(r"^namespace \{$.*?^\}  // namespace$", "", text, flags=re.M | re.S)
    return [found[1] for line in named.splitlines() if (found := TYPE.match(line))]


def main(root: pathlib.Path) -> int:
    places: dict[str, set[pathlib.Path]] = collections.defaultdict(set)
    for folder in ("include", "forward", "inverse", "planner", "src"):
        for pattern in ("*.h", "*.cpp"):
            for path in (root / folder).rglob(pattern):
                for name in types(path.read_text()):
                    places[name].add(path.relative_to(root))
    twice = {name: sorted(paths) for name, paths in places.items() if len(paths) > 1}
    for name, paths in sorted(twice.items()):
        print(f"{name}: defined in {', '.join(map(str, paths))}, accepted: in one file")
    if len(places) < 100:
        print(f"{root}: found {len(places)} types, accepted: the project's hundreds")
        return 1
    return 1 if twice else 0


if __name__ == "__main__":
    sys.exit(main(pathlib.Path(sys.argv[1])))

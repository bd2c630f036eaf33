#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""docs/figures.py in a small repository of its own: what it runs, stores, writes, and how it tells
that a figure is old. Needs git and Python's standard library only.

    test_figures.py ROOT
"""
import json
import os
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

SCRIPT = Path(sys.argv.pop(1)).resolve() / "docs/figures.py"

PROGRAM = """#!/bin/sh
[ "$1" = --version ] && { echo "blindcorner 1.2.3 ($(cat "$(dirname "$0")/../../commit"))"; exit; }
printf 'name,error\\na,0.0%s\\nb,0.5\\n' "$(cat source/model)" > "$OUT/t.csv"
printf '{"rows": [{"name": "x", "low": 1, "value": 2, "high": 3}]}' > "$OUT/t.json"
echo "took 12.5 ms"
"""
DEFINITIONS = {
    "format": "blindcorner.figures/1",
    "runs": {"study": {"commands": ["blindcorner"], "minutes": 1, "depends": ["source"],
                       "quiet": True}},
    "figures": {
        "error": {"run": "study", "read": {"csv": "t.csv", "where": {"name": "a"}, "column": "error"},
                  "unit": "cm", "scale": 100, "digits": 1},
        "worst": {"run": "study", "read": {"csv": "t.csv", "where": {}, "column": "error", "reduce": "max"}},
        "named": {"run": "study", "read": {"json": "t.json", "pointer": "/rows/[name=x]/value"},
                  "low": {"json": "t.json", "pointer": "/rows/0/low"},
                  "high": {"json": "t.json", "pointer": "/rows/0/high"}, "digits": 0},
        "time": {"run": "study", "read": {"output": r"took ([\d.]+) ms"}, "unit": "ms", "digits": 1},
    },
}
PAGE = """Error <!-- figure:error --><!-- /figure -->, worst <!-- figure:worst bare --><!-- /figure --> \
(<!-- age:study --><!-- /age -->).

<!-- figure:named interval --><!-- /figure -->; <!-- figure:time --><!-- /figure -->
"""


class Figures(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = Path(folder.name).resolve()
        for name in ("docs/figures", "source", "build/release"):
            (self.root / name).mkdir(parents=True)
        (self.root / "source/model").write_text("4")
        (self.root / "README.md").write_text(PAGE)
        (self.root / "docs/figures.json").write_text(json.dumps(DEFINITIONS))
        program = self.root / "build/release/blindcorner"
        program.write_text(PROGRAM)
        program.chmod(0o755)
        self.git("init", "-q")
        self.commit("first")

    def git(self, *arguments):
        environment = {**os.environ, "GIT_CONFIG_GLOBAL": "/dev/null", "GIT_CONFIG_SYSTEM": "/dev/null"}
        for who in ("AUTHOR", "COMMITTER"):
            environment.update({f"GIT_{who}_NAME": "test", f"GIT_{who}_EMAIL": "test@example.org"})
        return subprocess.run(["git", *arguments], cwd=self.root, env=environment, check=True,
                              capture_output=True, text=True).stdout.strip()

    def commit(self, message):
        self.git("add", "README.md", "docs", "source")
        self.git("commit", "-q", "-m", message)
        (self.root / "commit").write_text(self.git("rev-parse", "--short=7", "HEAD"))

    def figures(self, *arguments, code=0):
        more = ["--busy", "--build", str(self.root / "build/release")] if arguments[0] == "run" else []
        done = subprocess.run([sys.executable, SCRIPT, "--root", self.root, *arguments, *more],
                              capture_output=True, text=True)
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        return done.stdout + done.stderr

    def page(self):
        return (self.root / "README.md").read_text()

    def test_what_is_run_is_what_the_page_says(self):
        self.figures("run", "error")
        stored = json.loads((self.root / "docs/figures/study.json").read_text())
        self.assertEqual((stored["version"], stored["commit"]), ("1.2.3", self.git("rev-parse", "--short=7", "HEAD")))
        self.assertGreaterEqual(stored["machine"]["cores"], 1)
        self.figures("write")
        for part in (">4.0 cm<", ">0.50<", ">this version", ">2 (1 to 3)<", ">12.5 ms<"):
            self.assertIn(part, self.page())
        self.figures("check")

    def test_the_table_of_runs_says_how_long_the_last_one_took(self):
        (self.root / "README.md").write_text(PAGE + "<!-- table:runs --><!-- /table -->\n")
        self.figures("run", "study")
        self.figures("write")
        row = "| `study` | 0.1 | `blindcorner` |"
        self.assertIn(row, self.page())  # 1 is the estimate before
        self.figures("check")
        (self.root / "README.md").write_text(self.page().replace("0.1", "25"))
        self.assertIn(f'runs: found "{row.replace("0.1", "25")}", accepted: "{row}"',
                      self.figures("check", code=1))

    def test_run_times_of_a_busy_machine_are_called_so(self):
        self.figures("run", "study")
        path = self.root / "docs/figures/study.json"
        stored = json.loads(path.read_text())
        for load, says in ((stored["machine"]["cores"] + 1, True), (0.2, False)):
            stored["machine"]["load"] = load
            path.write_text(json.dumps(stored))
            self.figures("write")
            self.assertEqual(">this version, busy machine<" in self.page(), says)

    def test_a_page_that_says_something_else_is_wrong(self):
        self.figures("run", "--all")
        self.figures("write")
        (self.root / "README.md").write_text(self.page().replace("4.0 cm", "3.0 cm"))
        self.assertIn('error: found "3.0 cm", accepted: "4.0 cm"', self.figures("check", code=1))

    def test_a_figure_older_than_its_source_says_so(self):
        self.figures("run", "study")
        self.figures("write")
        self.commit("measured")
        made = json.loads((self.root / "docs/figures/study.json").read_text())["commit"]
        self.figures("check")
        (self.root / "source/model").write_text("3")
        self.assertIn("docs/figures.py write", self.figures("check", code=1))  # before the commit, too
        self.commit("another model")
        self.figures("check", code=1)
        self.figures("write")
        self.assertIn(f">4.0 cm (of 1.2.3, {made})<", self.page())
        self.assertIn(f">of 1.2.3, {made}", self.page())
        self.figures("check")
        self.figures("run", "--stale")
        self.figures("write")
        self.assertIn(">3.0 cm<", self.page())

    def test_comments_and_what_cmake_reads_leave_it_current(self):
        source = self.root / "source/model.cpp"
        source.write_text("// old\nconst char* a = \"/* b */ // c\";  /* of\n two */ int n = 1'000;\n")
        self.commit("a model")
        self.figures("run", "study")
        self.figures("write")
        source.write_text("/* new */ const char* a =\n  \"/* b */ // c\"; int n = 1'000;  // n\n")
        (self.root / "source/CMakeLists.txt").write_text("how the model is compiled\n")
        self.commit("comments, and what CMake reads")
        self.figures("check")
        self.assertNotIn("study", self.figures("run", "--stale"))
        source.write_text("const char* a = \"/* b */ // d\"; int n = 1'000;\n")
        self.commit("a string")
        self.assertIn("study", self.figures("list"))
        self.figures("check", code=1)

    def test_changes_elsewhere_leave_it_current(self):
        self.figures("run", "study")
        self.figures("write")
        (self.root / "docs/other.md").write_text("Nothing that the run depends on.\n")
        self.commit("a page")
        self.figures("check")
        self.assertNotIn("study", self.figures("run", "--stale"))

    def test_without_history_ages_stay_as_they_are_written(self):
        self.figures("run", "study")
        (self.root / "source/model").write_text("3")
        self.figures("write")
        subprocess.run(["rm", "-rf", self.root / ".git"], check=True)
        self.assertIn("ages of figures were not checked", self.figures("check"))
        (self.root / "README.md").write_text(self.page().replace("4.0 cm", "3.0 cm"))
        self.figures("check", code=1)

    def test_of_a_commit_that_is_not_here_ages_stay_as_they_are_written(self):
        self.figures("run", "study")
        self.figures("write")
        path = self.root / "docs/figures/study.json"
        stored = json.loads(path.read_text())
        stored["commit"] = "0123abc"
        path.write_text(json.dumps(stored))
        (self.root / "source/model").write_text("3")
        self.figures("check")
        self.assertIn("of a commit that is not here", self.figures("list"))

    def test_what_cannot_be_read_is_one_line(self):
        definitions = json.loads(json.dumps(DEFINITIONS))
        definitions["figures"]["error"]["read"]["where"] = {"name": "c"}
        (self.root / "docs/figures.json").write_text(json.dumps(definitions))
        self.assertIn("figure error: 0 values fit", self.figures("run", "study", code=1))
        self.assertIn("run: found nonsense", self.figures("run", "nonsense", code=2))

    def test_values_that_could_not_be_read_are_read_from_what_the_run_left(self):
        definitions = json.loads(json.dumps(DEFINITIONS))
        definitions["figures"]["time"]["read"]["output"] = r"took ([\d.]+) s"
        path = self.root / "docs/figures.json"
        path.write_text(json.dumps(definitions))
        self.assertIn("0 values fit", self.figures("run", "study", code=1))
        self.assertFalse((self.root / "docs/figures/study.json").exists())

        path.write_text(json.dumps(DEFINITIONS))
        (self.root / "build/release/blindcorner").unlink()
        self.figures("run", "--kept", "study")
        stored = json.loads((self.root / "docs/figures/study.json").read_text())
        self.assertEqual(stored["figures"]["time"]["value"], 12.5)
        self.assertEqual(stored["version"], "1.2.3")

        definitions["runs"]["study"]["commands"] = ["blindcorner more"]
        path.write_text(json.dumps(definitions))
        self.assertIn("its files are of other commands", self.figures("run", "--kept", "study", code=1))
        shutil.rmtree(self.root / "build/figures")
        self.assertIn("build/figures/study/run.json is missing", self.figures("run", "--kept", "study", code=1))

    def test_a_plain_figure_needs_its_age_beside_it(self):
        self.figures("run", "study")
        (self.root / "README.md").write_text(PAGE.replace("<!-- age:study --><!-- /age -->", ""))
        self.assertIn("its line has to state", self.figures("write", code=2))


if __name__ == "__main__":
    if shutil.which("git") is None:
        print("SKIPPED: git was not found (Debian: git)")
        sys.exit()
    unittest.main()

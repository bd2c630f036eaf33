#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Measures the figures that README.md and docs/*.md state, and writes them there.

    docs/figures.py list                    every run with its age and the time that it takes
    docs/figures.py run NAME... | --stale | --all [--longest MINUTES]
    docs/figures.py write                   puts the stored values and their ages between the markers
    docs/figures.py check                   exit code 1 where a page does not say what is stored

docs/figures.json names every run: its commands, the files and folders of the source that it depends
on, an estimate of how long it takes, and for each figure where its value is read from. `run` takes names of runs or
of figures, executes the commands with bash in the repository's root (PATH begins with the build folder,
OUT names an empty folder), and stores docs/figures/RUN.json: values, intervals, the program's version
and commit, machine, date and time. Only Python's standard library is needed. A run's files stay in
build/figures/RUN: where a value could not be read, `run --kept RUN` reads it once docs/figures.json is mended.

Markers in a page, all invisible where Markdown is shown:

    <!-- figure:NAME -->4.4 cm<!-- /figure -->           value with unit; its age, where it has one
    <!-- figure:NAME interval -->                        the same with its interval
    <!-- figure:NAME plain -->                           without age: the line has to state `age:RUN`
    <!-- figure:NAME bare -->                            `plain` and without the unit
    <!-- age:RUN -->this version<!-- /age -->            how old the run is
    <!-- table:runs -->...<!-- /table -->                all runs: minutes and commands

A run is of this version as long as what it depends on is what it was at the run's commit; comments of
C++ files and lists of what CMake compiles do not count.
"""
import argparse
import csv
import datetime
import itertools
import json
import math
import os
import re
import shutil
import statistics
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
EARLIER = "of an earlier version"
THIS = "this version"
# Sources and headers that only drives have.
DRIVES = ("io/drive_file.*", "simulation/*drive*", "simulation/true_world.*", "simulation/trial*",
          "simulation/*perception*", "simulation/sightings.*", "simulation/movers.*",
          "simulation/simulated_sensor.*")
BUSY = 0.5  # programs for each core from which a run's own times are not measured, by judgement
MARKER = re.compile(
    r"<!-- (figure|age|table):([a-z0-9_]+)((?: [a-z]+)*) -->(.*?)<!-- /\1 -->", re.DOTALL)


class Problem(Exception):
    """A mistake of a file or of an argument, as one line for the user."""


# --- What is stored -----------------------------------------------------------------------------


def load_definitions(root):
    """The runs and figures of docs/figures.json, checked."""
    with open(root / "docs/figures.json", encoding="utf-8") as file:
        definitions = json.load(file)
    for name, run in definitions["runs"].items():
        for field in ("commands", "depends", "minutes"):
            if field not in run:
                raise Problem(f"docs/figures.json: runs.{name}.{field} is missing")
        for path in run["depends"]:
            if not (root / path).exists():
                raise Problem(f"docs/figures.json: runs.{name}.depends: {path} does not exist")
    for name, figure in definitions["figures"].items():
        if figure["run"] not in definitions["runs"]:
            raise Problem(f"docs/figures.json: figures.{name}.run: found \"{figure['run']}\", accepted: a run")
    return definitions


def stored_path(root, run):
    return root / "docs/figures" / f"{run}.json"


def load_stored(root, run):
    """What the last run has stored, or None."""
    path = stored_path(root, run)
    if not path.exists():
        return None
    with open(path, encoding="utf-8") as file:
        return json.load(file)


# --- How old a run is ---------------------------------------------------------------------------


def git(root, *arguments):
    try:
        return subprocess.run(["git", "-C", str(root), *arguments], capture_output=True, text=True)
    except FileNotFoundError:
        return subprocess.CompletedProcess(arguments, 127, "", "")


def has_history(root):
    """Whether root is the top of a git repository whose history is complete."""
    top = git(root, "rev-parse", "--show-toplevel")
    if top.returncode != 0 or Path(top.stdout.strip()).resolve() != root.resolve():
        return False
    return git(root, "rev-parse", "--is-shallow-repository").stdout.strip() == "false"


def pathspecs(depends):
    """Git's names of what a run depends on: its folders but for what CMake reads, their public headers,
    and, unless it drives (depends on the planner), nothing that only drives have."""
    headers = [f"include/blindcorner/{path.removeprefix('src/')}" for path in depends]
    specs = [*depends, *headers, ":(exclude,glob)**/CMakeLists.txt"]
    if "planner" in depends:
        return specs
    return [*specs, *(f":!{folder}/{name}" for folder in ("src", "include/blindcorner") for name in DRIVES)]


COMMENT_OR_TOKEN = re.compile(
    r"""(?P<comment>//[^\n]*|/\*.*?\*/)|R"(?P<mark>[^(\s]*)\(.*?\)(?P=mark)"|"(?:\\.|[^"\\])*\""""
    r"""|\b\d[\w.']*|'(?:\\.|[^'\\])*'|\s+""", re.DOTALL)


def code_of(source):
    """C++ source without its comments, and with one space for any white space outside of literals."""
    def kept(match):
        return " " if match.group("comment") or match.group().isspace() else match.group()
    return re.sub(" +", " ", COMMENT_OR_TOKEN.sub(kept, source)).strip()


def has_same_code(root, commit, path):
    """Whether a file is today what it was at the commit, or a C++ file that differs in comments only."""
    then, now = git(root, "show", f"{commit}:{path}"), root / path
    if Path(path).suffix not in (".cpp", ".h") or then.returncode != 0 or not now.exists():
        return False
    return code_of(then.stdout) == code_of(now.read_text())


def is_current(root, stored, depends):
    """Whether what the run depends on is today what it was then, but for comments."""
    commit = stored.get("commit")
    if not commit or stored.get("modified"):
        return False
    changed = git(root, "diff", "--name-only", "-z", "--relative", commit, "--", *pathspecs(depends))
    return changed.returncode == 0 and all(
        has_same_code(root, commit, path) for path in changed.stdout.split("\0") if path)


def age_of(root, stored, depends):
    """How a page states the age of a run: THIS, or the version that the values are of; None where the
    repository does not have the run's commit, so that nobody can tell."""
    if stored.get("version") is None:
        return EARLIER
    if stored.get("commit") and git(root, "cat-file", "-e", stored["commit"] + "^{commit}").returncode:
        return None
    if is_current(root, stored, depends):
        return THIS
    commit = stored.get("commit")
    known = f"{stored['version']}, {commit}" if commit else stored["version"]
    return f"of {known}{', modified' if stored.get('modified') else ''}"


# --- How pages state values ---------------------------------------------------------------------


def number(value, figure):
    if isinstance(value, str):
        return value
    return f"{value:.{figure.get('digits', 2)}f}"


def with_unit(text, figure):
    unit = figure.get("unit", "")
    return f"{text} {unit}" if unit else text


def stated(figure, entry, words):
    """The text of one figure without its age."""
    text = number(entry["value"], figure)
    if "interval" in words:
        if entry.get("low") is None:
            raise Problem("a marker asks for an interval that the run did not measure")
        text += f" ({number(entry['low'], figure)} to {number(entry['high'], figure)})"
    return text if "bare" in words else with_unit(text, figure)


class Pages:
    """README.md and docs/*.md with the stored values between their markers."""

    def __init__(self, root):
        self.root = root
        self.definitions = load_definitions(root)
        self.dated = has_history(root)  # without history, ages stay as they are written
        self.stored = {run: load_stored(root, run) for run in self.definitions["runs"]}
        self.used = set()

    def paths(self):
        return [self.root / "README.md", *sorted((self.root / "docs").glob("*.md"))]

    def age(self, run):
        stored = self.stored.get(run)
        if stored is None:
            raise Problem(f"docs/figures/{run}.json is missing (docs/figures.py run {run})")
        return age_of(self.root, stored, self.definitions["runs"][run]["depends"])

    def value(self, name, words, written):
        figure = self.definitions["figures"].get(name)
        if figure is None:
            raise Problem(f"figure {name} is not in docs/figures.json")
        stored = self.stored[figure["run"]]
        if stored is None or name not in stored["figures"]:
            raise Problem(f"figure {name} was never measured (docs/figures.py run {name})")
        self.used.add(name)
        text = stated(figure, stored["figures"][name], words)
        if "plain" in words or "bare" in words:
            return text
        age = self.age(figure["run"]) if self.dated else None
        if age is None:
            return written if written == text or written.startswith(text + " (of ") else text
        return text if age == THIS else f"{text} ({age})"

    def minutes(self, run):
        """How long a run takes: what it took last, in tenths rounded up, and an estimate before that
        was measured."""
        seconds = (self.stored[run] or {}).get("seconds")
        return self.definitions["runs"][run]["minutes"] if seconds is None else max(1, math.ceil(seconds / 6)) / 10

    def table_of_runs(self):
        rows = ["| run | minutes or so | commands |", "|---|---|---|"]
        for name, run in self.definitions["runs"].items():
            commands = "<br>".join(f"`{command}`" for command in run["commands"])
            rows.append(f"| `{name}` | {self.minutes(name):.1f} | {commands} |")
        return "\n\n" + "\n".join(rows) + "\n\n"

    def line_states_age(self, text, match, run):
        begin = text.rfind("\n", 0, match.start()) + 1
        end = text.find("\n", match.end())
        return f"<!-- age:{run} -->" in text[begin : end if end >= 0 else len(text)]

    def replacement(self, text, match):
        kind, name, words, written = match[1], match[2], match[3].split(), match[4]
        if kind == "age":
            if name not in self.definitions["runs"]:
                raise Problem(f"run {name} is not in docs/figures.json")
            age = self.age(name) if self.dated else None
            content = written if age is None else age
            if age is not None and self.definitions["runs"][name].get("quiet") and is_busy(self.stored[name]):
                content += ", busy machine"
        elif kind == "table":
            if name != "runs":
                raise Problem(f"table {name}: accepted: runs")
            content = self.table_of_runs()
        else:
            content = self.value(name, words, written)
            run = self.definitions["figures"][name]["run"]
            if ("plain" in words or "bare" in words) and not self.line_states_age(text, match, run):
                raise Problem(f"figure {name}: its line has to state <!-- age:{run} --><!-- /age -->")
        return f"<!-- {kind}:{name}{match[3]} -->{content}<!-- /{kind} -->"

    def rewritten(self):
        """Pairs of a page and what it should hold; the pages that differ are wrong."""
        pairs = []
        for path in self.paths():
            text = path.read_text(encoding="utf-8")
            try:
                pairs.append((path, text, MARKER.sub(lambda m: self.replacement(text, m), text)))
            except Problem as problem:
                raise Problem(f"{path.relative_to(self.root)}: {problem}") from None
        return pairs

    def unused(self):
        return sorted(set(self.definitions["figures"]) - self.used)


# --- Running ------------------------------------------------------------------------------------


def read_pointer(document, pointer):
    """The value at a JSON pointer, in which [name=text] is the entry of a list that has this name,
    and [name^=text] the one whose name begins so."""
    for part in pointer.strip("/").split("/"):
        named = re.fullmatch(r"\[(\w+)(\^?)=(.*)\]", part)
        if named:
            document = next(entry for entry in document if entry[named[1]] == named[3]
                            or (named[2] and entry[named[1]].startswith(named[3])))
        else:
            document = document[int(part)] if isinstance(document, list) else document[part]
    return document


def cells(path, where, column):
    """A column's values in the rows in which the columns of `where` hold what it says."""
    with open(path, newline="", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if all(row[k] == v for k, v in where.items())]
    return [row[column] for row in rows]


def candidates(source, out):
    """All values that a `read` of docs/figures.json names: at a JSON pointer, in cells of a CSV file,
    or groups of a regular expression in a file or in what the commands print."""
    if "json" in source:
        with open(out / source["json"], encoding="utf-8") as file:
            return [read_pointer(json.load(file), source["pointer"])]
    if "csv" in source:
        return cells(out / source["csv"], source["where"], source["column"])
    text = (out / ("output.txt" if "output" in source else source["file"])).read_text(encoding="utf-8")
    return re.findall(source.get("output") or source["regex"], text, re.MULTILINE)


REDUCE = {"max": max, "min": min, "sum": sum, "median": statistics.median}


def read_value(source, out):
    """One value of those candidates: the only one, their number, or what `reduce` makes of them."""
    values = candidates(source, out)
    reduce = source.get("reduce")
    if reduce == "count":
        return len(values)
    if source.get("text") and len(values) == 1:
        return values[0]
    numbers = [float(value) for value in values]
    if reduce:
        return REDUCE[reduce](numbers)
    if len(numbers) != 1:
        raise Problem(f"{len(numbers)} values fit {source}, accepted: 1")
    return numbers[0]


def scaled(value, figure):
    return value * figure["scale"] if "scale" in figure and not isinstance(value, str) else value


def measured(name, figure, out):
    try:
        entry = {"value": scaled(read_value(figure["read"], out), figure)}
        for end in ("low", "high"):
            if end in figure:
                entry[end] = scaled(read_value(figure[end], out), figure)
    except Problem as problem:
        raise Problem(f"figure {name}: {problem}") from None
    except (OSError, KeyError, IndexError, ValueError, StopIteration) as error:
        raise Problem(f"figure {name}: {error!r}") from error
    return entry


def machine():
    """Processor, cores that this process may use, and programs that wanted one (mean of a minute)."""
    processor = "unknown"
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            found = re.search(r"model name\s*:\s*(.*)", file.read())
        processor = found[1].strip() if found else processor
    except OSError:
        pass
    return {"processor": processor, "cores": len(os.sched_getaffinity(0)),
            "load": round(os.getloadavg()[0], 1)}


def is_busy(stored):
    """Whether other programs took part of the machine, so that run times are too long."""
    at = stored.get("machine")
    return bool(at) and at.get("load", 0) > BUSY * at["cores"]


def program_version(program):
    """(version, commit, modified) as `blindcorner --version` says."""
    text = subprocess.run([program, "--version"], capture_output=True, text=True, check=True).stdout
    found = re.search(r"blindcorner (\S+)(?: \((\w+?)(-modified)?\))?", text)
    commit = found[2] if found[2] and found[2] != "unknown" else None
    return found[1], commit, bool(found[3])


def execute(root, build, name, run):
    """Runs the commands, which leave their files and output.txt. Returns how long it took, s."""
    out = root / "build/figures" / name
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    environment = dict(os.environ, OUT=str(out), PATH=f"{build}:{os.environ['PATH']}")
    if any("BLINDCORNER_DATA" in c for c in run["commands"]) and "BLINDCORNER_DATA" not in environment:
        raise Problem(f"run {name}: BLINDCORNER_DATA is not set (docs/measured.md says which data sets there are)")
    begin = time.monotonic()
    done = subprocess.run(["bash", "-euo", "pipefail", "-c", "\n".join(run["commands"])], cwd=root,
                          env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    seconds = time.monotonic() - begin
    (out / "output.txt").write_text(done.stdout, encoding="utf-8")
    if done.returncode not in run.get("exit_codes", [0]):
        raise Problem(f"run {name} ended with {done.returncode}; the end of its output:\n{done.stdout[-2000:]}")
    return seconds


def kept_path(root, name):
    """What is known of the last run, beside the files that it left."""
    return root / "build/figures" / name / "run.json"


def measure(root, build, definitions, name):
    """Executes a run and stores its values."""
    version, commit, modified = program_version(build / "blindcorner")
    where = machine()
    run = definitions["runs"][name]
    seconds = execute(root, build, name, run)
    record = {
        "run": name, "version": version, "commit": commit, "modified": modified,
        "date": datetime.date.today().isoformat(), "machine": where, "seconds": round(seconds, 1),
    }
    kept_path(root, name).write_text(
        json.dumps({"commands": run["commands"], "record": record}), encoding="utf-8")
    return store_values(root, definitions, name)


def store_values(root, definitions, name):
    """Reads a run's values from the files that it left, and stores them."""
    path = kept_path(root, name)
    if not path.exists():
        raise Problem(f"run {name}: {path.relative_to(root)} is missing; docs/figures.py run {name} makes it")
    kept = json.loads(path.read_text(encoding="utf-8"))
    if kept["commands"] != definitions["runs"][name]["commands"]:
        raise Problem(f"run {name}: its files are of other commands; docs/figures.py run {name} makes new ones")
    record = kept["record"]
    record["figures"] = {key: measured(key, figure, path.parent)
                         for key, figure in definitions["figures"].items() if figure["run"] == name}
    stored_path(root, name).write_text(json.dumps(record, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    return record


# --- Commands -----------------------------------------------------------------------------------


def chosen_runs(arguments, pages):
    """Names of the runs that the command line asks for, the quickest first."""
    runs, figures = pages.definitions["runs"], pages.definitions["figures"]
    if arguments.all:
        names = set(runs)
    elif arguments.stale:
        names = {run for run in runs if pages.stored[run] is None or pages.age(run) != THIS}
    else:
        unknown = [name for name in arguments.names if name not in runs and name not in figures]
        if unknown or not arguments.names:
            raise Problem(f"run: found {' '.join(unknown) or 'no name'}, accepted: "
                          f"names of docs/figures.py list, --stale or --all")
        names = {name if name in runs else figures[name]["run"] for name in arguments.names}
    if arguments.longest is not None:
        names = {name for name in names if pages.minutes(name) <= arguments.longest}
    return sorted(names, key=pages.minutes)


def command_run(root, arguments):
    pages = Pages(root)
    build = Path(arguments.build).resolve()
    if not arguments.kept and not (build / "blindcorner").exists():
        raise Problem(f"{build}/blindcorner is missing; ./bootstrap.sh fit builds it")
    failed = 0
    for name in chosen_runs(arguments, pages):
        if pages.definitions["runs"][name].get("quiet") and not arguments.busy and not arguments.kept:
            here = machine()
            if is_busy({"machine": here}):
                print(f"{name}: left out, it measures times and other programs want the machine (load "
                      f"{here['load']}, {here['cores']} cores; --busy)")
                continue
        try:
            if arguments.kept:
                record = store_values(root, pages.definitions, name)
            else:
                print(f"{name}: {pages.minutes(name):.1f} minutes or so", flush=True)
                record = measure(root, build, pages.definitions, name)
        except Problem as problem:
            failed += 1
            print(f"figures.py: {problem}", file=sys.stderr)
            continue
        for key, entry in record["figures"].items():
            words = ["interval"] if "low" in entry else []
            print(f"  {key}: {stated(pages.definitions['figures'][key], entry, words)}")
    return 1 if failed else 0


def command_write(root, _):
    for path, before, after in Pages(root).rewritten():
        if before != after:
            path.write_text(after, encoding="utf-8")
            print(f"{path.relative_to(root)}: written")
    return 0


def first_difference(before, after):
    for was, is_now in zip(MARKER.finditer(before), MARKER.finditer(after)):
        if was[0] != is_now[0]:
            lines = itertools.zip_longest(was[4].split("\n"), is_now[4].split("\n"), fillvalue="")
            return was[2], *next(pair for pair in lines if pair[0] != pair[1])
    raise AssertionError("pages differ outside of their markers")


def command_check(root, _):
    pages = Pages(root)
    wrong = 0
    for path, before, after in pages.rewritten():
        if before != after:
            wrong += 1
            name, states, holds = first_difference(before, after)
            print(f"{path.relative_to(root)}: {name}: found \"{states}\", accepted: \"{holds}\" "
                  f"(docs/figures.py write)")
    for name in pages.unused():
        wrong += 1
        print(f"docs/figures.json: figures.{name}: no page states it")
    if not pages.dated:
        print("There is no complete git history here: the ages of figures were not checked.")
    return 1 if wrong else 0


def command_list(root, _):
    pages = Pages(root)
    for name in pages.definitions["runs"]:
        stored = pages.stored[name]
        age = "never measured" if stored is None else pages.age(name) or "of a commit that is not here"
        count = sum(figure["run"] == name for figure in pages.definitions["figures"].values())
        print(f"{name:28} {pages.minutes(name):7.1f} minutes  {count:3} figures  {age}")
    return 0


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--root", type=Path, default=ROOT, help="the repository")
    commands = parser.add_subparsers(dest="command", required=True)
    run = commands.add_parser("run", help="measure")
    run.add_argument("names", nargs="*", metavar="NAME", help="of a run or of a figure")
    run.add_argument("--stale", action="store_true", help="runs older than what they depend on")
    run.add_argument("--all", action="store_true", help="every run")
    run.add_argument("--longest", type=float, metavar="MINUTES", help="leave longer runs out")
    run.add_argument("--busy", action="store_true", help="measure times on a busy machine, too")
    run.add_argument("--kept", action="store_true",
                     help="read the values again from the files that the last run left")
    run.add_argument("--build", default=ROOT / "build/release", help="folder of the program")
    commands.add_parser("write", help="write the stored values into the pages")
    commands.add_parser("check", help="compare the pages with the stored values")
    commands.add_parser("list", help="every run with its age")
    arguments = parser.parse_args()
    action = {"run": command_run, "write": command_write, "check": command_check, "list": command_list}
    try:
        sys.exit(action[arguments.command](arguments.root.resolve(), arguments))
    except Problem as problem:
        print(f"figures.py: {problem}", file=sys.stderr)
        sys.exit(2)


if __name__ == "__main__":
    main()

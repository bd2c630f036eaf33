#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""README.md and docs/*.md: links lead somewhere, commands are ones that the program accepts, files
exist, examples are what the sources hold.

    check_pages.py ROOT PROGRAM [--write]     --write: examples are copied from their sources first

Prints a line for each mistake; exit code 1 where there is one. Needs Python's standard library only.
"""
import re
import shlex
import subprocess
import sys
from functools import lru_cache
from pathlib import Path

MOST_README_LINES = 150
TOP_FOLDERS = ("forward/", "inverse/", "planner/", "src/", "include/", "tests/", "docs/", "scenes/",
               "schema/", "python/", "cmake/")
FENCE = re.compile(r"^ *(```+)(.*)$")


class Page:
    """A page's text, split into prose and code."""

    def __init__(self, path):
        self.path = path
        self.text = path.read_text(encoding="utf-8")
        self.prose, self.code = [], []  # lines with their numbers
        self.fences = []                # (language, text) of fenced blocks
        self._split()

    def _split(self):
        fence, block, before_blank = None, [], True
        for number, line in enumerate(self.text.splitlines(), 1):
            found = FENCE.match(line)
            if fence is not None:
                if found and found[1] == fence[0]:
                    self.fences.append((fence[1], "\n".join(block) + "\n"))
                    fence, block = None, []
                else:
                    block.append(line)
                    self.code.append((number, line))
                continue
            if found:
                fence = (found[1], found[2].strip())
            elif line.startswith("    ") and before_blank:
                self.code.append((number, line[4:]))
                continue  # an indented block goes on
            else:
                self.prose.append((number, line))
            before_blank = not line.strip()

    def anchors(self):
        """Anchors of the headings as GitHub makes them."""
        known = {}
        for _, line in self.prose:
            found = re.match(r"#{1,6} (.*)", line)
            if found:
                anchor = slug(found[1])
                count = known.get(anchor, -1) + 1
                known[anchor] = count
                if count:
                    known[f"{anchor}-{count}"] = 0
        return set(known)


def slug(heading):
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).replace("`", "")
    return re.sub(r"[^\w\- ]", "", text.strip().lower()).replace(" ", "-")


def links(page):
    """(line, target) of all links and pictures, those of references too."""
    for number, line in page.prose:
        bare = re.sub(r"`[^`]*`", "", line)
        for target in re.findall(r"\]\(([^)\s]+)\)", bare):
            yield number, target
        for target in re.findall(r"^\[[^\]]+\]:\s+(\S+)", bare):
            yield number, target


def wrong_links(root, page, pages):
    for number, target in links(page):
        if re.match(r"[a-z]+:", target):
            continue
        name, _, anchor = target.partition("#")
        path = (page.path.parent / name).resolve() if name else page.path
        if not path.exists():
            yield number, f"link to {target}: there is no such file"
        elif root not in path.parents and path != root:
            yield number, f"link to {target}: leads out of the repository"
        elif anchor and path in pages and anchor not in pages[path].anchors():
            yield number, f"link to {target}: the page has no such heading"


def spans(page):
    """(line, text) of inline code; a span may go on over a line's end."""
    offset_line = {}
    text = ""
    for number, line in page.prose:
        offset_line[len(text)] = number
        text += line + "\n"
    starts = sorted(offset_line)
    for found in re.finditer(r"(?<!`)`([^`]+)`(?!`)", text):
        number = offset_line[max(s for s in starts if s <= found.start())]
        yield number, " ".join(found[1].split())


def commands(page):
    """(line, command) of all calls of the program, from its name on."""
    for number, code in [*page.code, *spans(page)]:
        code = code.split(" #")[0].strip().removeprefix("$ ")
        found = re.match(r"(?:[A-Z_]+=\S+ )*(?:build/release/|\./)?(blindcorner|\$B) (.*)", code)
        if found:
            for part in re.split(r"\s*(?:&&|;|\|(?= ?[a-z]+ )|>)\s*", found[2])[:1]:
                yield number, part


@lru_cache(maxsize=None)
def help_of(program, words):
    done = subprocess.run([program, *words, "--help"], capture_output=True, text=True)
    return done.stdout if done.returncode == 0 else None


@lru_cache(maxsize=None)
def subcommands(program, words):
    text = help_of(program, words) or ""
    _, _, after = text.partition("Subcommands:")
    return set(re.findall(r"^  (\S+)", after, re.MULTILINE))


def split(command):
    try:
        return shlex.split(command)
    except ValueError:
        return command.split()


def wrong_command(program, command):
    """What is wrong with a command's words, or None."""
    words = [word.strip("[],.:;()") for word in split(command)]
    words = [word for word in words if word]
    chosen = []
    while words and subcommands(program, tuple(chosen)):
        if words[0].startswith("-") or words[0].isupper() or words[0] == "...":
            break
        choices = words[0].split("|")
        unknown = [c for c in choices if c not in subcommands(program, tuple(chosen))]
        if unknown:
            return f"there is no command {' '.join([*chosen, unknown[0]])}"
        chosen.append(choices[0])
        words = words[1:]
    text = help_of(program, tuple(chosen))
    if text is None:
        return f"{' '.join(chosen)} --help does not end well"
    known = set(re.findall(r"(?<![\w-])--?[A-Za-z][\w-]*", text)) | {"--help", "--version", "-h"}
    for word in words:
        option = re.match(r"--?[A-Za-z][\w-]*", word)
        if option and option[0] not in known:
            return f"{' '.join(chosen)} has no option {option[0]}"
    return None


def wrong_paths(root, page):
    """Files of the repository that code names and that are not there; `FILE` (new) is to be made."""
    new = set(re.findall(r"`([^`\s]+)` \(new\)", page.text))
    for number, code in [*page.code, *spans(page)]:
        if code.startswith("ln -s "):
            continue  # what it names last is made by it
        for word in re.findall(r"(?<![\w./$-])((?:[\w-]+/)+[\w.*{},-]+)", code):
            if not word.startswith(TOP_FOLDERS) or set(word) & set("*{}<>"):
                continue
            word = word.rstrip(".,")
            if word in new or re.search(r"/[A-Z]+(?:/|$)", word):  # the last is a placeholder
                continue
            if not (root / word).exists() and not (root / "include/blindcorner" / word).exists():
                yield number, f"{word}: there is no such file"


EXAMPLE = re.compile(r"(<!-- source: (\S+)(?: (\w+))? -->\n+```\w*\n)(.*?)```", re.DOTALL)


def example_of(root, file, name):
    """What a source holds: all of it, or what stands between the lines `// [name]` and `// [/name]`.
    None where there is none."""
    if not (root / file).exists():
        return None
    text = (root / file).read_text(encoding="utf-8")
    if not name:
        return text
    part = re.search(rf"^ *(?://|#) \[{name}\]\n(.*?)^ *(?://|#) \[/{name}\]", text, re.DOTALL | re.MULTILINE)
    return part[1] if part else None


def wrong_examples(root, page):
    """A fenced block under a line `<!-- source: FILE NAME -->` is what the file holds."""
    for found in EXAMPLE.finditer(page.text):
        number = page.text[: found.start()].count("\n") + 1
        if example_of(root, found[2], found[3]) != found[4]:
            yield number, f"the example is not what {found[2]} holds (check_pages.py --write)"


def write_examples(root):
    for path in [root / "README.md", *sorted((root / "docs").glob("*.md"))]:
        text = path.read_text(encoding="utf-8")
        path.write_text(EXAMPLE.sub(
            lambda m: f"{m[1]}{example_of(root, m[2], m[3]) or m[4]}```", text), encoding="utf-8")


def mistakes(root, program):
    paths = [root / "README.md", *sorted((root / "docs").glob("*.md"))]
    pages = {path: Page(path) for path in paths}
    for path, page in pages.items():
        name = path.relative_to(root)
        found = [*wrong_links(root, page, pages), *wrong_paths(root, page), *wrong_examples(root, page)]
        for number, command in commands(page):
            wrong = wrong_command(program, command)
            if wrong:
                found.append((number, f"`blindcorner {command}`: {wrong}"))
        for number, text in sorted(set(found)):
            yield f"{name}:{number}: {text}"
    length = len(pages[paths[0]].text.splitlines())
    if length > MOST_README_LINES:
        yield f"README.md: found {length} lines, accepted: at most {MOST_README_LINES}"
    contents = {target.partition("#")[0] for _, target in links(pages[root / "docs/README.md"])}
    for path in paths[1:]:
        if path.name not in contents | {"README.md"}:
            yield f"docs/README.md: does not name {path.name}"
    listed = {c.partition(" ")[0] for _, c in commands(pages[root / "docs/commands.md"])}
    for command in sorted(subcommands(program, ()) - listed - {"man"}):
        yield f"docs/commands.md: does not name the command {command}"
    version = re.search(r"project\(blindcorner VERSION ([\d.]+)", (root / "CMakeLists.txt").read_text())[1]
    if f"\nversion: {version}\n" not in (root / "CITATION.cff").read_text(encoding="utf-8"):
        yield f"CITATION.cff: version: accepted: {version}, the project's"


def main():
    if len(sys.argv) not in (3, 4) or sys.argv[3:] not in ([], ["--write"]):
        sys.exit(__doc__)
    if sys.argv[3:]:
        write_examples(Path(sys.argv[1]).resolve())
    count = 0
    for mistake in mistakes(Path(sys.argv[1]).resolve(), sys.argv[2]):
        count += 1
        print(mistake)
    sys.exit(1 if count else 0)


if __name__ == "__main__":
    main()

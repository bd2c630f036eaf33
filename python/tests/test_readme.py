# SPDX-License-Identifier: Apache-2.0
"""What README.md and docs/python.md show runs as it stands, and answers what they say."""

import doctest
import re
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
README = ROOT / "README.md"
NUMBER = re.compile(r"-?\d+\.?\d*(?:e[-+]?\d+)?")


def test_first_fit(capsys):
    blocks = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)
    assert len(blocks) == 1
    names = {}
    exec(compile(blocks[0], str(README), "exec"), names)
    said = capsys.readouterr().out
    headline = said.splitlines()[0]
    assert f"`{headline}`" in " ".join(README.read_text(encoding="utf-8").split())
    result, captures = names["result"], names["captures"]
    truth = np.array([captures.truth[0][name] for name in names["scene"].unknowns])
    off = (result.mean - truth)[:3]  # of the position; yaw is circular
    squared = off @ np.linalg.solve(result.covariance[:3, :3], off)
    assert squared < 16  # of three unknowns: exceeded by 1 of 1000


class AlikeNumbers(doctest.OutputChecker):
    """The same words, and numbers that agree to a hundredth or to one of their last digits."""

    def check_output(self, want, got, optionflags):
        def words(text):
            return NUMBER.sub("#", text).split()

        def numbers(text):
            return [(float(n), 10.0 ** -len(n.partition(".")[2])) for n in NUMBER.findall(text)]

        return words(want) == words(got) and all(
            abs(a - b) <= max(0.01 * abs(a), 1.01 * digit)
            for (a, digit), (b, _) in zip(numbers(want), numbers(got)))


def test_session():
    page = ROOT / "docs" / "python.md"
    test = doctest.DocTestParser().get_doctest(page.read_text(encoding="utf-8"), {}, page.name,
                                               str(page), 0)
    assert len(test.examples) == 10
    said = []
    doctest.DocTestRunner(checker=AlikeNumbers()).run(test, out=said.append)
    assert not said, "".join(said)

"""Scenic's soft keywords as names of a program: which contexts take them, and what comes out.

Run where Scenic 3.1.1 is (`python soft_keywords.py OUT`): writes OUT, a JSON object with the outcome of every soft
keyword in every context. `tests/units/compiler/test_soft_keywords.py` compares.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

HEADER = "ego = new Object at (20, 20)\n"
CONTEXTS: dict[str, str] = {
    "operand": "W = 3\nparam answer = W",
    "first in a sum": "W = 3\nparam answer = W + 1",
    "last in a sum": "W = 3\nparam answer = 1 + W",
    "in brackets": "W = 3\nparam answer = (W)",
    "in a list": "W = 3\nparam answer = [W, 1][0]",
    "last in a list": "W = 3\nparam answer = [1, W][1]",
    "after a sign": "W = 3\nparam answer = -W",
    "after not": "W = 3\nparam answer = not W",
    "before and": "W = 3\nparam answer = W and 5",
    "after or": "W = 3\nparam answer = 0 or W",
    "before a comparison": "W = 3\nparam answer = W < 4",
    "after a comparison": "W = 3\nparam answer = 4 < W",
    "before if": "W = 3\nparam answer = W if 1 else 2",
    "test of if": "W = 3\nparam answer = 1 if W else 2",
    "indexed": "W = [1, 3]\nparam answer = W[1]",
    "called": "def W(x):\n    return x + 1\nparam answer = W(3)",
    "called without arguments": "def W():\n    return 3\nparam answer = W()",
    "attribute of": "W = new Point at (3, 4)\nparam answer = W.position.x",
    "argument": "W = 3\nparam answer = max(W, 1)",
    "keyword argument": "def f(W=1):\n    return W\nparam answer = f(W=3)",
    "parameter": "def f(W):\n    return W + 1\nparam answer = f(3)",
    "parameter of a lambda": "f = lambda W: W + 1\nparam answer = f(3)",
    "property": "o = new Object at (9, 9), with W 3\nparam answer = o.W",
    "property of a class": "class A(Object):\n    W: 3\no = new A at (9, 9)\nparam answer = o.W",
    "class": "class W(Object):\n    width: 3\no = new W at (9, 9)\nparam answer = o.width",
    "param": "param W = 3\nparam answer = globalParameters.W",
    "variable of a loop": "for W in [1, 3]:\n    pass\nparam answer = W",
    "variable of a comprehension": "param answer = [W + 1 for W in [3]][0]",
    "unpacked": "W, x = 3, 4\nparam answer = W",
    "augmented": "W = 3\nW += 1\nparam answer = W",
    "chained": "W = x = 3\nparam answer = x",
    "key of a dictionary": "W = 3\nparam answer = {W: 5}[3]",
    "formatted": 'W = 3\nparam answer = f"{W}"',
    "a statement of its own": "W = 3\nW\nparam answer = 1",
    "a call as a statement": "def W(x):\n    return x\nW(3)\nparam answer = 1",
    "require": "W = 3\nrequire W > 2\nparam answer = 1",
    "coordinate": "W = 3\no = new Object at (W, 9)\nparam answer = o.position.x",
    "before @": "W = 3\nparam answer = (W @ 9).x",
    "after @": "W = 3\nparam answer = (9 @ W).y",
    "after at": "W = (3, 9)\no = new Object at W\nparam answer = o.position.x",
    "after facing": "W = 0.5\no = new Object at (9, 9), facing W\nparam answer = o.heading",
    "before deg": "W = 90\nparam answer = W deg",
    "after with width": "W = 3\no = new Object at (9, 9), with width W\nparam answer = o.width",
    "after behind": "W = new OrientedPoint at (9, 9)\no = new Object behind W by 2\nparam answer = o.position.x",
    "after left of": "W = new OrientedPoint at (9, 9)\no = new Object left of W by 2\nparam answer = o.position.y",
    "after by": "W = 2\np = new OrientedPoint at (9, 9)\no = new Object left of p by W\nparam answer = o.position.x",
    "after offset by": "W = (3, 3)\nparam answer = ((1, 1) offset by W).x",
    "before offset by": "W = (3, 3)\nparam answer = (W offset by (1, 1)).x",
    "after relative to": "W = 0.5\no = new Object at (9, 9), facing 0.25 relative to W\nparam answer = o.heading",
    "before relative to": "W = 0.5\no = new Object at (9, 9), facing W relative to 0.25\nparam answer = o.heading",
    "after distance to": "W = (20, 23)\nparam answer = distance to W",
    "after distance from": "W = (20, 23)\nparam answer = distance from W to (20, 20)",
    "after to": "W = (20, 23)\nparam answer = distance from (20, 20) to W",
    "after can see": "W = (20, 23)\nrequire ego can see W\nparam answer = 1",
    "after front of": "W = ego\nparam answer = (front of W).position.x",
    "after visible": "W = CircularRegion((20, 20), 3)\no = new Object on visible W\nparam answer = 1",
}
"""Programs with the word `W` as a name; what they compute stands in the parameter `answer`."""


def program(context: str, word: str) -> str:
    """A program with a soft keyword as a name."""
    pieces = CONTEXTS[context].split("W")
    text = pieces[0]
    for piece in pieces[1:]:
        alone = not (text[-1:].isalnum() or piece[:1].isalnum() or piece[:1] == "_")
        text += (word if alone else "W") + piece
    return f"{HEADER}{text}\n"


def outcome(text: str) -> Any:
    """What Scenic says: the answer, or None where it refuses the program."""
    import scenic

    try:
        scene, _ = scenic.scenarioFromString(text, mode2D=True).generate(maxIterations=100)
    except Exception:
        return None
    return plain(scene.params.get("answer"))


def plain(answer: Any) -> Any:
    """An answer that can be compared and kept: a number of six digits, a text, or "?" for anything else."""
    if isinstance(answer, bool | str):
        return answer
    return round(float(answer), 6) if isinstance(answer, int | float) else "?"


def main(out: Path) -> None:
    """Ask Scenic for every word in every context, and keep the outcomes where they differ from the usual one."""
    from scenic.syntax.parser import ScenicParser

    kept: dict[str, Any] = {"words": sorted(ScenicParser.SOFT_KEYWORDS), "usual": {}, "others": {}}
    for context in CONTEXTS:
        usual = outcome(program(context, "plain"))
        found = {word: outcome(program(context, word)) for word in kept["words"]}
        kept["usual"][context] = usual
        kept["others"][context] = {word: each for word, each in found.items() if each != usual}
        out.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))

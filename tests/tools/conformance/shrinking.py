"""Makes a program smaller as long as it shows the same fault."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator


def shrink(text: str, same: Callable[[str], bool], most: int = 60) -> str:
    """A smaller program with the same fault.

    Args:
        text: The program.
        same: Whether a program shows the fault.
        most: Programs to try.
    """
    tried, progress = 0, True
    while progress:
        progress = False
        for smaller in candidates(text):
            tried += 1
            if tried > most:
                return text
            if same(smaller):
                text, progress = smaller, True
                break
    return text


def candidates(text: str) -> Iterator[str]:
    """The program without one of its statements, then without one of its specifiers."""
    blocks = re.findall(r"^\S.*\n(?:[ \t]+.*\n)*", text, re.MULTILINE)
    for gone in reversed(range(len(blocks))):
        if not blocks[gone].startswith("model "):
            yield "".join(blocks[:gone] + blocks[gone + 1 :])
    for place, block in enumerate(blocks):
        if "# free" in block or " new " not in block or len(block.splitlines()) > 1:
            continue
        parts = _specifiers(block.rstrip("\n"))
        for gone in range(1, len(parts)):
            shorter = ", ".join(part for n, part in enumerate(parts) if n != gone)
            yield "".join([*blocks[:place], shorter + "\n", *blocks[place + 1 :]])


def _specifiers(line: str) -> list[str]:
    """The parts between the commas that are in no brackets."""
    parts, depth, start = list[str](), 0, 0
    for at, character in enumerate(line):
        depth += (character in "([{") - (character in ")]}")
        if character == "," and depth == 0:
            parts.append(line[start:at].strip())
            start = at + 1
    return [*parts, line[start:].strip()]

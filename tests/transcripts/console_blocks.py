"""Pages that show commands with what they print: their blocks, and whether that is what is printed.

In a `console` block, a line `$ command` is run; the lines up to the next command are what it prints, where `...` stands
for anything.
"""

import re
from collections.abc import Iterator

_BLOCK = re.compile(r"^```(\w+)(?: (\S+))?\n(.*?)^```", re.DOTALL | re.MULTILINE)
_COMMAND = re.compile(r"^\$ ", re.MULTILINE)


def blocks(page: str, *kinds: str) -> Iterator[re.Match[str]]:
    """The blocks of these kinds: groups are the kind, the name of a file, and the text."""
    return (found for found in _BLOCK.finditer(page) if found[1] in kinds)


def steps(block: str) -> Iterator[tuple[str, str]]:
    """The commands of a block, each with what it prints."""
    for part in _COMMAND.split(block)[1:]:
        command, _, output = part.partition("\n")
        yield command, output


def matches(expected: str, actual: str) -> bool:
    """Whether what is printed is what stands there, but for white space at the ends of lines."""
    actual = re.sub(r"[ \t]+$", "", actual, flags=re.MULTILINE)
    parts = [re.escape(part) for part in expected.strip().split("...")]
    return re.fullmatch(".*".join(parts), actual.strip(), re.DOTALL) is not None

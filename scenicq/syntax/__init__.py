"""Text to syntax tree, without meaning.

`parse` reads the three spellings of Scenic (1: the 2019 paper, 2, 3) into the nodes of `ast`; `walk` visits them.
"""

from scenicq.syntax.parser import parse
from scenicq.syntax.walk import children, walk

__all__ = ["children", "parse", "walk"]

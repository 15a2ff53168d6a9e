"""The legend: each sign of pictures with its meaning, drawn as in pictures."""

from __future__ import annotations

__all__ = ["SIGNS"]

_BOX = '<path class="outline" d="M-225 -95h450v190h-450z"></path><path class="nose" d="M0 0h225"></path>'
SIGNS = (
    ("an object of the label; the line points to its front", f'<g class="box other">{_BOX}</g>'),
    ("one with a role", f'<g class="box other c1">{_BOX}</g>'),
    ("a person", '<g class="box other person"><circle class="dot" r="70"></circle></g>'),
    ("the ego", f'<g class="box ego c0">{_BOX}</g>'),
    ("a size that the label does not have", f'<g class="box other nominal">{_BOX}</g>'),
    ("where a role may be", '<path class="place local c1" d="M-230 -110h460v220h-460z"></path>'),
    ("the same, where the map alone says so", '<path class="place fixed c1" d="M-230 -110h460v220h-460z"></path>'),
    ("which way it may face", '<path class="facing c1" d="M-200 0L180 -110L220 0L180 110z"></path>'),
    ("a view region", '<path class="view" d="M-220 0L220 -125V125z"></path>'),
    ("a distance that a requirement speaks of", '<path class="distance" d="M-220 0H220"></path>'),
    ("a hidden point of the witness", '<path class="hidden-point" d="M-60 -60l120 120m0 -120l-120 120"></path>'),
    (
        "what excludes the frame: thick and red",
        f'<path class="place local blamed" d="M-240 -120h480v240h-480z"></path><g class="box other blamed">{_BOX}</g>',
    ),
    ("direction of traffic", '<g class="map"><path class="direction" d="M-45 -55L45 0L-45 55"></path></g>'),
)
"""Meaning and sign of each."""

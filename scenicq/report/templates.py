"""Pages as templates: what is put into them is escaped, unless it is markup that a template or our own `svg` has made.

A template's lines are joined without what they are indented by. Jinja is loaded by the first page that is made.
"""

from __future__ import annotations

from functools import cache
from importlib import resources
from typing import TYPE_CHECKING

from scenicq.report.svg import escape

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup

__all__ = ["asset", "markup"]


def asset(name: str) -> str:
    """The text of a file that pages are made of."""
    return resources.files("scenicq.report").joinpath("assets", name).read_text(encoding="utf-8")


@cache
def _environment() -> Environment:
    from jinja2 import Environment, FunctionLoader, StrictUndefined  # noqa: PLC0415 - most commands make no page
    from markupsafe import Markup  # noqa: PLC0415

    def escaped(value: object) -> Markup:
        # the escape of pictures, which also knows what neither HTML nor XML can hold
        return value if isinstance(value, Markup) else Markup(escape(value))  # noqa: S704 - escaped here

    def load(name: str) -> str:
        return "".join(line.strip() for line in asset(name).splitlines())

    return Environment(
        autoescape=True, loader=FunctionLoader(load), undefined=StrictUndefined, finalize=escaped, auto_reload=False
    )


def markup(template: str, macro: str, **values: object) -> Markup:
    """Markup that a macro of a template makes.

    Args:
        template: The name of its file among the assets, without `.html`.
        macro: The name of the macro.
        values: Its arguments. Pictures are texts that the template marks as safe; all else is escaped.
    """
    return getattr(_environment().get_template(f"{template}.html").module, macro)(**values)

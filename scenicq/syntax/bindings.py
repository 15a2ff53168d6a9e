"""What gets a name: targets of assignments and loops, parameters."""

from __future__ import annotations

from abc import abstractmethod
from typing import Literal

from scenicq.syntax import ast
from scenicq.syntax.texts import TextParser

__all__ = ["BindingParser"]


class BindingParser(TextParser):
    """Reads targets and parameters."""

    @abstractmethod
    def atom(self) -> ast.Expression:
        """Read a name, a literal or a display."""

    @abstractmethod
    def postfix(self, start: int, node: ast.Expression) -> ast.Expression:
        """Read the attributes, calls and subscripts after an operand."""

    def targets(self) -> ast.Expression:
        """Read what a loop assigns to: targets separated by commas."""
        start = self.token.start
        items: list[ast.Expression] = []
        several = False
        while True:
            star = self.token.start
            if self.accept("*"):
                target = self.postfix(self.token.start, self.atom())
                items.append(ast.Starred(self.span(star), target))
            else:
                items.append(self.postfix(star, self.atom()))
            self.check_target(items[-1])
            if not self.accept(","):
                break
            several = True
            if self.text in ("in", "="):
                break
        return ast.Tuple(self.span(start), tuple(items)) if several else items[0]

    def check_target(self, node: ast.Expression) -> None:
        """Refuse what cannot be assigned to."""
        match node:
            case ast.Name() | ast.Attribute() | ast.Subscript():
                return
            case ast.Starred():
                self.check_target(node.value)
            case ast.Tuple() | ast.List():
                for item in node.items:
                    self.check_target(item)
            case ast.ComparisonChain() | ast.Call():
                hint = "`==` compares" if isinstance(node, ast.ComparisonChain) else ""
                raise self.fail("only a name, an attribute or an element can be assigned to", node.span, hint=hint)
            case _:
                raise self.fail("only a name, an attribute or an element can be assigned to", node.span)

    def parameters(self, closer: Literal[")", ":"]) -> tuple[ast.Parameter, ...]:
        """Read parameters up to the closer, which stays; annotations are for functions only, which close with `)`."""
        parameters: list[ast.Parameter] = []
        keyword_only = False
        while self.text != closer:
            start = self.token.start
            if self.text == "/" and parameters and not keyword_only:
                self.advance()
                parameters = [
                    ast.Parameter(p.span, p.name, "positional-only", p.annotation, p.default) for p in parameters
                ]
            elif self.text == "*" and self.peek().text == ",":
                self.advance()
                keyword_only = True
            else:
                parameters.append(self.parameter(start, closer == ")", keyword_only))
                keyword_only = keyword_only or parameters[-1].kind == "*"
            if not self.accept(",") and self.text != closer:
                raise self.fail(f"a comma or `{closer}` is missing after the parameter", label=self.found())
        self.check_parameters(parameters)
        return tuple(parameters)

    def parameter(self, start: int, annotated: bool, keyword_only: bool) -> ast.Parameter:
        """Read one parameter."""
        star = self.advance().text if self.text in ("*", "**") else ""
        name = self.name("the name of a parameter").text
        annotation = self.expression() if annotated and self.accept(":") else None
        default = self.expression() if not star and self.accept("=") else None
        kind = "*" if star == "*" else "**" if star else "keyword-only" if keyword_only else "positional"
        return ast.Parameter(self.span(start), name, kind, annotation, default)

    def check_parameters(self, parameters: list[ast.Parameter]) -> None:
        """Refuse parameters that contradict each other."""
        names: set[str] = set()
        defaults = False
        for parameter in parameters:
            if parameter.name in names:
                raise self.fail(f"two parameters are called `{parameter.name}`", parameter.span)
            names.add(parameter.name)
            if parameter.kind in ("positional", "positional-only"):
                if defaults and parameter.default is None:
                    raise self.fail(f"`{parameter.name}` needs a default, as the one before it has", parameter.span)
                defaults = parameter.default is not None
        for before in parameters[:-1]:
            if before.kind == "**":
                raise self.fail("nothing can follow the parameter with `**`", before.span)

    def lambda_(self) -> ast.Expression:
        """Read `lambda parameters: body`."""
        start = self.advance().start
        parameters = self.parameters(":")
        self.advance()
        body = self.expression()
        return ast.Lambda(self.span(start), parameters, body)

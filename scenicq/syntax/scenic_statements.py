"""Scenic's own statements; their words stay usable as names where they start none."""

from __future__ import annotations

from typing import Self

from scenicq.errors import Span
from scenicq.syntax import ast
from scenicq.syntax.literals import decode, string_parts
from scenicq.syntax.phrases import INFIX_WORDS
from scenicq.syntax.precedence import POWER
from scenicq.syntax.statements import StatementParser
from scenicq.syntax.tokens import CLOSERS, Token

__all__ = ["ProgramParser"]

_NOT_AFTER_WORD = frozenset(
    ("=", ".", ",", ":", ";", ")", "]", "}", "", "+=", "-=", "*=", "/=", "//=", "%=", "**=", "<<=", ">>=", "&=", "|=",
     "^=", "@=", ":=", "==", "!=", "<", "<=", ">", ">=", "*", "/", "//", "%", "**", "@", "+", "&", "|", "^")
)  # fmt: skip
_DEFINITIONS = frozenset(("behavior", "monitor", "scenario"))
_BLOCKS = frozenset(("setup", "compose", "precondition", "invariant"))


class ProgramParser(StatementParser):
    """Reads whole programs."""

    def part(self, tokens: list[Token]) -> Self:
        """A parser of the same program for the tokens of a part of it."""
        part = type(self)(self.source, tokens)
        part.classes, part.variables, part.has_new = self.classes, self.variables, self.has_new
        return part

    def takes_expression(self) -> bool:
        """Whether a statement's word is followed by its expression, and is not just a name itself."""
        following = self.peek()
        return following.text not in _NOT_AFTER_WORD and (
            following.kind != "keyword" or self.starts_operand(self.index + 1)
        )

    def takes_name(self) -> bool:
        """Whether a name follows that is no operator."""
        following = self.peek()
        return following.kind == "name" and following.text not in INFIX_WORDS

    def scenic_statement(self) -> ast.Statement | None:
        """Read one of Scenic's own statements with the end of its line, or nothing where none starts."""
        if self.token.kind != "name":
            return None
        match self.text:
            case "model" if self.takes_name():
                return self.model()
            case "param" if self.takes_name() or self.peek().kind == "string" or self.peek(2).text == "=":
                return self.param()
            case "require" if self.takes_expression():
                return self.require()
            case "mutate" if self.takes_name() or not self.peek().text or self.peek().text in ("by", ";"):
                return self.mutate()
            case "simulator" if self.takes_name():
                start = self.advance().start
                value = self.expression()
                return ast.Simulator(self.span(start), value)
            case word if word in _DEFINITIONS and self.takes_name():
                return self.definition(word)
            case word if word in _BLOCKS and self.peek().text == ":" and self.peek(2).kind == "newline":
                return self.definition(word)
            case word:
                return self.dynamic(word)

    def model(self) -> ast.Statement:
        """Read `model`."""
        start = self.advance().start
        place = self.token.start
        name = self.dotted("the name of the world model")
        return ast.Model(self.span(start), name, self.span(place))

    def param(self) -> ast.Statement:
        """Read `param`."""
        start = self.advance().start
        items: list[ast.ParamItem] = []
        while not items or self.accept(","):
            if items and self.at_line_end():
                break
            token = self.token
            if token.kind == "string":
                self.advance()
                prefix, begin, end = string_parts(token)
                name = decode(self.source, begin, end, raw="r" in prefix, binary=False)
            else:
                name = self.name("the name of the parameter").text
            self.expect("=", "after the name of the parameter", "write `param name = value`")
            value = self.expression()
            items.append(ast.ParamItem(self.span(token.start), name, self.token_span(token), value))
        return ast.Param(self.span(start), tuple(items))

    def require(self) -> ast.Statement:
        """Read `require`."""
        start = self.advance().start
        if self.text == "monitor" and self.takes_name():
            self.advance()
            monitor = self.expression()
            return ast.RequireMonitor(self.span(start), monitor)
        probability: ast.Expression | None = None
        if self.text == "[" and self._is_probability():
            probability = self.subscript()
        self.temporal = True
        condition = self.expression()
        self.temporal = False
        name = self.name_after("requirement")
        return ast.Require(self.span(start), condition, probability, name)

    def _is_probability(self) -> bool:
        """Whether the brackets after `require` stand before a condition, rather than begin it."""
        if self.peek().kind == "number" and self.peek(2).text == "]":
            return True
        ahead, depth = 1, 1
        while depth and self.peek(ahead).kind != "end":
            text = self.peek(ahead).text
            depth += (text in CLOSERS) - (text in CLOSERS.values())
            ahead += 1
        after = self.peek(ahead)
        continues = after.text in ("[", "(", "-", "+") or after.text in INFIX_WORDS
        return not continues and self.starts_operand(self.index + ahead)

    def name_after(self, what: str) -> str | None:
        """Read `as NAME` after what may have a name."""
        if not self.accept("as"):
            return None
        if self.token.kind not in ("name", "number", "string"):
            raise self.fail(f"the name of the {what} is missing", label=self.found())
        return self.advance().text.strip("\"'")

    def mutate(self) -> ast.Statement:
        """Read `mutate`."""
        start = self.advance().start
        objects: list[ast.Expression] = []
        if self.text != "by" and not self.at_line_end():
            while not objects or self.accept(","):
                objects.append(self.operand(POWER))
        scale = self.expression() if self.accept("by") else None
        return ast.Mutate(self.span(start), tuple(objects), scale)

    def definition(self, kind: str) -> ast.Statement:
        """Read a monitor, or read past another definition of what happens over time."""
        start = self.advance().start
        name = self.advance().text if kind in _DEFINITIONS else ""
        if kind == "monitor":
            return self.monitor(start, name)
        if self.text == "(":
            self.move(self.closing(self.index))
            self.advance()
        self.expect(":", f"after the header of the {kind}")
        node = ast.DynamicDefinition(self.span(start), kind, name)
        self.skip()
        return node

    def monitor(self, start: int, name: str) -> ast.Statement:
        """Read the parameters of a monitor, if it has any, and its body."""
        parameters: tuple[ast.Parameter, ...] = ()
        if self.accept("("):
            parameters = self.parameters(")")
            self.advance()
        header = Span(self.source, start, self.token.end)
        return ast.DynamicDefinition(header, "monitor", name, parameters, self.block("the header of the monitor"))

    def terminate(self, kind: str) -> ast.Statement:
        """Read `terminate when`, `terminate after` or `terminate simulation`."""
        start = self.advance().start
        self.advance()
        if kind == "terminate simulation" and not self.accept("when"):
            return ast.DynamicStatement(self.span(start), kind)
        operand = self.expression()
        unit = self.unit() if kind == "terminate after" else ""
        if not unit:
            self.name_after("condition")
        return ast.DynamicStatement(self.span(start), kind, operand, unit)

    def wait(self, kind: str) -> ast.Statement:
        """Read `wait for` or `wait until`."""
        start = self.advance().start
        self.advance()
        operand = self.expression()
        unit = self.unit() if kind == "wait for" else ""
        return ast.DynamicStatement(self.span(start), kind, operand, unit)

    def unit(self) -> str:
        """Read the unit of a time."""
        if self.text not in ("seconds", "steps"):
            raise self.fail("`seconds` or `steps` is missing", label=self.found())
        return self.advance().text

    def dynamic(self, word: str) -> ast.Statement | None:
        """Read past a statement about what happens over time, or nothing where none starts."""
        kind = self.dynamic_kind(word, self.peek().text)
        if not kind:
            return None
        if kind.startswith("terminate "):
            return self.terminate(kind)
        if kind in ("wait for", "wait until"):
            return self.wait(kind)
        start = self.token.start
        while not self.at_line_end():
            self.advance()
        return ast.DynamicStatement(self.span(start), kind)

    def dynamic_kind(self, word: str, following: str) -> str:
        """Tell what kind of statement about time two words start."""
        match word:
            case "terminate":
                if following in ("when", "after", "simulation"):
                    return f"terminate {following}"
                return "terminate" if following in ("", ";") else ""
            case "record":
                if following in ("initial", "final"):
                    return f"record {following}"
                return "record" if self.takes_expression() else ""
            case "do":
                if following in ("choose", "shuffle"):
                    return f"do {following}"
                return "do" if self.takes_expression() else ""
            case "take" | "invoke":
                return word if self.takes_expression() else ""
            case "override":
                return word if self.takes_name() else ""
            case "wait":
                if following in ("for", "until"):
                    return f"wait {following}"
                return word if following in ("", ";") else ""
            case "abort":
                return word if following in ("", ";") else ""
            case _:
                return ""

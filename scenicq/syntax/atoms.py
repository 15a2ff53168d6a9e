"""Expressions without operators: names, numbers, displays, calls, subscripts."""

from __future__ import annotations

from typing import Literal

from scenicq.errors import Note, ScenarioError
from scenicq.syntax import ast
from scenicq.syntax.bindings import BindingParser
from scenicq.syntax.hints import phrase_hint
from scenicq.syntax.literals import number_value
from scenicq.syntax.tokens import Token

__all__ = ["AtomParser"]

_VALUES = {"True": True, "False": False, "None": None}
_FOREIGN = {"&&": "write `and`", "||": "write `or`", "<>": "write `!=`", "++": "write `+= 1`"}
_ORDER = frozenset({"<", ">", "<=", ">=", "==", "!=", "="})


class AtomParser(BindingParser):
    """Reads operands; what is inside of brackets comes back through `expression`."""

    def atom(self) -> ast.Expression:
        """Read a name, a literal or a display."""
        token = self.token
        match token.kind:
            case "name":
                self.advance()
                return ast.Name(self.token_span(token), token.text)
            case "number":
                self.advance()
                return ast.LiteralValue(self.token_span(token), number_value(self.source, token))
            case "string":
                return self.strings()
            case "keyword" if token.text in _VALUES:
                self.advance()
                return ast.LiteralValue(self.token_span(token), _VALUES[token.text])
            case _:
                pass
        match token.text:
            case "(":
                return self.group()
            case "[":
                return self.listing()
            case "{":
                return self.braces()
            case "...":
                self.advance()
                return ast.LiteralValue(self.token_span(token), ...)
            case "":
                raise self.fail("an expression is missing", label=self.found())
            case "lambda":
                raise self.fail("a lambda needs parentheses here")
            case text:
                hint = _FOREIGN.get(f"{self.tokens[self.index - 1].text}{text}", "")
                hint = hint or phrase_hint(self.tokens, self.index)
                if text in _ORDER and self.index > 1 and self.tokens[self.index - 2].text == "with":
                    name = self.tokens[self.index - 1].text
                    hint = f"`with {name} Range(a, b)` gives an interval; `require X.{name} {text} ...` compares"
                elif text in _ORDER and self.tokens[self.index - 1].text == "by":
                    hint = "`by Range(a, b)` gives an interval"
                message = f"`{text}` cannot start an expression"
                raise self.fail(message, label="an expression is missing here", hint=hint)

    def postfix(self, start: int, node: ast.Expression) -> ast.Expression:
        """Read the attributes, calls and subscripts after an operand."""
        while True:
            if self.text == ".":
                self.advance()
                name = self.name("the name of an attribute")
                node = ast.Attribute(self.span(start), node, name.text, self.token_span(name))
            elif self.text == "(":
                arguments = self.arguments()
                node = ast.Call(self.span(start), node, arguments)
            elif self.text == "[":
                index = self.subscript()
                node = ast.Subscript(self.span(start), node, index)
            else:
                return node

    def arguments(self) -> tuple[ast.Argument, ...]:
        """Read `(...)` of a call."""
        opening = self.advance()
        temporal, self.temporal = self.temporal, False
        arguments: list[ast.Argument] = []
        while self.text != ")":
            arguments.append(self.argument())
            if arguments[-1].star == "" and self.at("for", "async"):
                element = arguments.pop()
                clauses = self.clauses()
                value = ast.Comprehension(self.span(element.span.start), "generator", element.value, clauses)
                arguments.append(ast.Argument(value.span, None, "", value))
                if len(arguments) > 1 or self.text != ")":
                    raise self.fail("a generator beside other arguments needs parentheses", value.span)
            if not self.accept(",") and self.text != ")":
                raise self.separator("arguments", opening)
        self.advance()
        self.temporal = temporal
        return tuple(arguments)

    def argument(self) -> ast.Argument:
        """Read one argument of a call."""
        start = self.token.start
        if self.text in ("*", "**"):
            star: Literal["*", "**"] = "*" if self.advance().text == "*" else "**"
            value = self.expression()
            return ast.Argument(self.span(start), None, star, value)
        if self.token.kind == "name" and self.peek().text == "=":
            name = self.advance().text
            self.advance()
            value = self.expression()
            return ast.Argument(self.span(start), name, "", value)
        value = self.named() if self.peek().text == ":=" else self.expression()
        return ast.Argument(self.span(start), None, "", value)

    def separator(self, what: str, opening: Token) -> ScenarioError:
        """The error for two things side by side in brackets."""
        hint = "`==` compares" if self.text == "=" else phrase_hint(self.tokens, self.index)
        message = f"a comma or the closing bracket is missing between {what}"
        opened = self.source.position(opening.start)[0] < self.source.position(self.token.start)[0]
        notes = (Note(self.token_span(opening), "this bracket is open"),) if opened else ()
        return self.fail(message, label=self.found(), hint=hint, notes=notes)

    def subscript(self) -> ast.Expression:
        """Read `[...]` after an operand."""
        opening = self.advance()
        temporal, self.temporal = self.temporal, False
        start = self.token.start
        if self.text == "]":
            raise self.fail("an index is missing between the brackets")
        items = [self.slice()]
        several = False
        while self.accept(","):
            several = True
            if self.text == "]":
                break
            items.append(self.slice())
        if self.text != "]":
            raise self.separator("indices", opening)
        node = ast.Tuple(self.span(start), tuple(items)) if several else items[0]
        self.advance()
        self.temporal = temporal
        return node

    def slice(self) -> ast.Expression:
        """Read an index or `lower:upper:step`."""
        start = self.token.start
        lower = None if self.text == ":" else self.named()
        if lower is not None and self.text != ":":
            return lower
        self.advance()
        upper = None if self.text in (":", "]", ",") else self.expression()
        step = None
        if self.accept(":") and self.text not in ("]", ","):
            step = self.expression()
        return ast.SubscriptSlice(self.span(start), lower, upper, step)

    def group(self) -> ast.Expression:
        """Read `(...)`: a tuple, a generator, or just an expression."""
        opening = self.advance()
        if self.accept(")"):
            return ast.Tuple(self.span(opening.start), ())
        first = self.named() if self.text in ("*", "yield") or self.peek().text == ":=" else self.expression()
        if self.text in ("for", "async"):
            clauses = self.clauses()
            self.close(")", "generator", opening)
            return ast.Comprehension(self.span(opening.start), "generator", first, clauses)
        if self.text != ",":
            self.close(")", "expression", opening)
            if isinstance(first, ast.Starred):
                raise self.fail("a star is of no use in parentheses without a comma", first.span)
            return first
        items = self.items(first, ")")
        self.close(")", "values", opening)
        return ast.Tuple(self.span(opening.start), items)

    def items(self, first: ast.Expression, closer: str) -> tuple[ast.Expression, ...]:
        """Read the other values of a display."""
        items = [first]
        while self.accept(","):
            if self.text == closer:
                break
            items.append(self.named())
        return tuple(items)

    def close(self, closer: str, what: str, opening: Token) -> None:
        """Read the closing bracket."""
        if not self.accept(closer):
            raise self.separator("values" if what == "values" else f"the parts of this {what}", opening)

    def listing(self) -> ast.Expression:
        """Read `[...]`."""
        opening = self.advance()
        temporal, self.temporal = self.temporal, False
        items: tuple[ast.Expression, ...] = ()
        if self.text != "]":
            first = self.named()
            if self.text in ("for", "async"):
                clauses = self.clauses()
                self.close("]", "list", opening)
                self.temporal = temporal
                return ast.Comprehension(self.span(opening.start), "list", first, clauses)
            items = self.items(first, "]")
        self.close("]", "values", opening)
        self.temporal = temporal
        return ast.List(self.span(opening.start), items)

    def braces(self) -> ast.Expression:
        """Read `{...}`: a dictionary or a set."""
        opening = self.advance()
        temporal, self.temporal = self.temporal, False
        node = self.braces_body(opening)
        self.temporal = temporal
        return node

    def braces_body(self, opening: Token) -> ast.Expression:
        """Read what follows the opening brace."""
        if self.accept("}"):
            return ast.Dict(self.span(opening.start), ())
        start = self.token.start
        if self.text != "**":
            first = self.named()
            if self.text in ("for", "async"):
                clauses = self.clauses()
                self.close("}", "set", opening)
                return ast.Comprehension(self.span(opening.start), "set", first, clauses)
            if self.text != ":":
                items = self.items(first, "}")
                self.close("}", "values", opening)
                return ast.Set(self.span(opening.start), items)
            self.advance()
            value = self.expression()
            if self.at("for", "async"):
                clauses = self.clauses()
                self.close("}", "dictionary", opening)
                return ast.DictComprehension(self.span(opening.start), first, value, clauses)
            pairs = [ast.DictItem(self.span(start), first, value)]
        else:
            pairs = [self.pair()]
        while self.accept(","):
            if self.at("}"):
                break
            pairs.append(self.pair())
        self.close("}", "values", opening)
        return ast.Dict(self.span(opening.start), tuple(pairs))

    def pair(self) -> ast.DictItem:
        """Read `key: value` or `**value`."""
        start = self.token.start
        if self.accept("**"):
            value = self.disjunction()
            return ast.DictItem(self.span(start), None, value)
        key = self.expression()
        self.expect(":", "after the key")
        value = self.expression()
        return ast.DictItem(self.span(start), key, value)

    def clauses(self) -> tuple[ast.Clause, ...]:
        """Read `for ... in ... if ...` of a comprehension, once or more."""
        clauses: list[ast.Clause] = []
        while self.text in ("for", "async"):
            start = self.token.start
            if self.accept("async"):
                raise self.fail("a comprehension cannot be asynchronous", self.span(start))
            self.advance()
            target = self.targets()
            self.expect("in", "after the variable of the loop")
            iterable = self.disjunction()
            conditions: list[ast.Expression] = []
            while self.accept("if"):
                conditions.append(self.disjunction())
            clauses.append(ast.Clause(self.span(start), target, iterable, tuple(conditions)))
        return tuple(clauses)

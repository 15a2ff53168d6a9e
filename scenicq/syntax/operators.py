"""Expressions with operators, by precedence climbing."""

from __future__ import annotations

from typing import Literal, cast

from scenicq.syntax import ast
from scenicq.syntax.precedence import (
    ALONG,
    AND,
    AT,
    COMPARISON,
    DEPENDENT,
    IMPLIES,
    LEVELS,
    NOT,
    OR,
    PREFIX,
    RELATIVE,
    SIGN,
    UNION,
    UNTIL,
)
from scenicq.syntax.prefixes import PrefixParser
from scenicq.syntax.tokens import CLOSERS

__all__ = ["OperatorParser"]

_TEMPORAL = ("always", "eventually", "next")
_SIGNS = ("-", "+", "~")


class OperatorParser(PrefixParser):
    """Reads expressions with operators."""

    def expression(self) -> ast.Expression:
        """Read one expression: no tuple without brackets, no `:=`, no star."""
        if self.text == "lambda":
            self.enter()
            node = self.lambda_()
            self.depth -= 1
            return node
        start = self.token.start
        return self.conditional(start, self.binary(UNTIL if self.temporal else OR))

    def conditional(self, start: int, then: ast.Expression) -> ast.Expression:
        """Read `if test else other` after a value, if it is there."""
        if self.text != "if":
            return then
        self.enter()
        self.advance()
        test = self.binary(UNTIL if self.temporal else OR)
        self.expect("else", "after the condition", "write `value if condition else other`")
        otherwise = self.expression()
        self.depth -= 1
        return ast.IfElse(self.span(start), test, then, otherwise)

    def disjunction(self) -> ast.Expression:
        """Read one expression that does not end in `if ... else` and is no lambda."""
        return self.binary(OR)

    def starred(self) -> ast.Expression:
        """Read `*value`."""
        start = self.advance().start
        value = self.binary(UNION)
        return ast.Starred(self.span(start), value)

    def binary(self, level: int) -> ast.Expression:
        """Read an expression of operators at least as tight as the level."""
        self.enter()
        start = self.token.start
        node = self.climb(start, self.operand(level), level)
        self.depth -= 1
        return node

    def level_here(self) -> int:
        """How tight the operator is that stands here; 0 for none."""
        text = self.text
        level = LEVELS.get(text, 0)
        if level and text in DEPENDENT:
            following = self.peek().text
            if following not in DEPENDENT[text]:
                return 0
            if text == "not" and following == "visible":
                return UNION if self.peek(2).text == "from" else 0
            if text == "offset" and following == "along":
                return ALONG
        return level

    def climb(self, start: int, left: ast.Expression, level: int) -> ast.Expression:
        """Read the operators after a left operand, as long as they are tight enough."""
        while True:
            here = self.level_here()
            if not here or here < level:
                return left
            if here == COMPARISON:
                left = self.comparison(start, left)
            elif here in (OR, AND):
                left = self.boolean(start, left, here)
            else:
                left = self.infix(start, left, here)

    def boolean(self, start: int, first: ast.Expression, level: int) -> ast.Expression:
        """Read the rest of a chain of `and` or of `or`."""
        operator: Literal["and", "or"] = "or" if level == OR else "and"
        values = [first]
        while self.accept(operator):
            values.append(self.binary(level + 1))
        return ast.BoolOp(self.span(start), operator, tuple(values))

    def comparison(self, start: int, left: ast.Expression) -> ast.Expression:
        """Read the rest of a chain of comparisons."""
        comparisons: list[ast.ComparisonLink] = []
        while self.level_here() == COMPARISON:
            place = self.token.start
            operator = self.advance().text
            if operator == "not":
                operator = f"not {self.advance().text}"
            elif operator == "is" and self.text in ("not", "in"):
                operator = "is not" if self.advance().text == "not" else "in"
            right = self.binary(UNION)
            words = cast('Literal["==", "!=", "<", "<=", ">", ">=", "in", "not in", "is", "is not"]', operator)
            comparisons.append(ast.ComparisonLink(self.span(place), words, right))
        return ast.ComparisonChain(self.span(start), left, tuple(comparisons))

    def infix(self, start: int, left: ast.Expression, level: int) -> ast.Expression:
        """Read one operator and its right operand."""
        word = self.advance().text
        match word:
            case "deg":
                return ast.Deg(self.span(start), left)
            case "@":
                right = self.binary(SIGN)
                return ast.VectorOperator(self.span(start), left, right)
            case "at":
                right = self.binary(PREFIX)
                return ast.FieldAt(self.span(start), left, right)
            case "relative":
                self.advance()
                right = self.binary(AT)
                return ast.RelativeTo(self.span(start), left, right)
            case "offset":
                return self.offset_operator(start, left)
            case "can":
                self.advance()
                right = self.binary(ALONG)
                return ast.CanSee(self.span(start), left, right)
            case "intersects":
                right = self.binary(ALONG)
                return ast.IntersectsOperator(self.span(start), left, right)
            case "visible" | "not":
                if word == "not":
                    self.advance()
                self.advance()
                right = self.binary(ALONG)
                return ast.VisibleFrom(self.span(start), left, right, word == "not")
            case "until":
                right = self.binary(IMPLIES)
                return ast.UntilOperator(self.span(start), left, right)
            case "implies":
                right = self.binary(OR)
                if self.text == "implies":
                    raise self.fail("`implies` twice in a row needs parentheses")
                return ast.Implies(self.span(start), left, right)
            case "**":
                right = self.binary(SIGN)
            case _:
                right = self.binary(level + 1)
        symbol = cast('Literal["+", "-", "*", "/", "//", "%", "**", "<<", ">>", "&", "|", "^"]', word)
        return ast.BinaryOp(self.span(start), symbol, left, right)

    def offset_operator(self, start: int, left: ast.Expression) -> ast.Expression:
        """Read what follows `offset`."""
        if self.accept("by"):
            offset = self.binary(AT)
            return ast.OffsetBy(self.span(start), left, offset)
        self.advance()
        direction = self.binary(ALONG)
        self.expect("by", "after the direction", "write `offset along direction by vector`")
        offset = self.binary(RELATIVE)
        return ast.OffsetAlong(self.span(start), left, direction, offset)

    def operand(self, level: int) -> ast.Expression:
        """Read what stands before, between or after operators; a class with specifiers is an instance."""
        token = self.token
        text = token.text
        if token.kind == "name":
            if self.is_prefix():
                return self.prefix_at(level)
            if text in _TEMPORAL and self.is_temporal(level):
                return self.temporal_operator()
            if text == "new" and self.peek().kind == "name" and self.names_class(self.index + 1):
                return self.new()
            if text == "initial" and self.peek().text == "scenario":
                self.advance()
                self.advance()
                return ast.InitialScenario(self.span(token.start))
        elif text == "not":
            if self.peek().text == "visible" and self.starts_operand(self.index + 2):
                return self.prefix_at(level)
            if level > NOT:
                raise self.fail("`not` needs parentheses here", hint="put `not` and its operand in parentheses")
            self.advance()
            value = self.binary(NOT)
            return ast.UnaryOp(self.span(token.start), "not", value)
        elif text in _SIGNS:
            self.advance()
            value = self.binary(SIGN)
            symbol: Literal["-", "+", "~"] = "-" if text == "-" else "+" if text == "+" else "~"
            return ast.UnaryOp(self.span(token.start), symbol, value)
        elif text in ("await", "yield"):
            return self.unsupported()
        node = self.postfix(token.start, self.atom())
        is_name = token.kind == "name" and isinstance(node, ast.Name | ast.Attribute)
        if is_name and self.token.kind in ("name", "keyword") and self.starts_instance(node):
            return self.instance(token.start, node, keyword=False)
        return node

    def prefix_at(self, level: int) -> ast.Expression:
        """Read an operator that starts with words, where the operators around it are not too tight for it."""
        if level > PREFIX:
            hint = "put the operator and its operands in parentheses"
            raise self.fail(f"the operator that starts with `{self.text}` needs parentheses here", hint=hint)
        return self.prefix()

    def is_temporal(self, level: int) -> bool:
        """Whether `always`, `eventually` or `next` is an operator here, and not a function or a variable.

        Before a bracket or a sign it is one where a requirement may have one: `always -x < 3`, but not `y > always(x)`.
        """
        following = self.peek()
        if following.text in CLOSERS or following.text in _SIGNS:
            return self.temporal and level <= NOT
        if following.text == "relative" and self.peek(2).text == "to":
            return False
        return self.starts_operand(self.index + 1) and following.text != "*"

    def temporal_operator(self) -> ast.Expression:
        """Read `always x`, `eventually x` or `next x`."""
        token = self.advance()
        operand = self.binary(IMPLIES)
        word: Literal["always", "eventually", "next"] = (
            "always" if token.text == "always" else "next" if token.text == "next" else "eventually"
        )
        return ast.Temporal(self.span(token.start), word, operand)

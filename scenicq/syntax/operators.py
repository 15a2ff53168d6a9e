"""Expressions with operators, by precedence climbing."""

from __future__ import annotations

from typing import Literal, cast

from scenicq.errors import Source
from scenicq.syntax import ast
from scenicq.syntax.phrases import INFIX_NAMES, INFIXES_AT, PREFIXES_AT, PhraseRow
from scenicq.syntax.precedence import AND, COMPARISON, IMPLIES, NOT, OR, POWER, PREFIX, PYTHON, SIGN, UNION, UNTIL
from scenicq.syntax.specifiers import InstanceParser
from scenicq.syntax.tokens import CLOSERS, Token

__all__ = ["OperatorParser"]

_SIGNS = ("-", "+", "~")
_AFTER_VISIBLE = INFIX_NAMES | {"(", "[", "{", *_SIGNS}
"""With these an operand starts after `visible`, which is then no name."""


class OperatorParser(InstanceParser):
    """Reads expressions with operators.

    Attributes:
        prefixes: What was read at a place, and the place after it: no operator that starts with words is read twice.
    """

    def __init__(self, source: Source, tokens: list[Token]) -> None:
        """Start at the first token."""
        super().__init__(source, tokens)
        self.prefixes: dict[int, tuple[ast.Phrase, int]] = {}

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

    def infix_here(self) -> PhraseRow | None:
        """Scenic's operator that stands here after a left operand."""
        for row in INFIXES_AT.get(self.text, ()):
            if self.reads(self.index, row.words):
                return row
        return None

    def python_level_here(self) -> int:
        """How tight Python's operator is that stands here; 0 for none."""
        level = PYTHON.get(self.text, 0)
        return 0 if self.text == "not" and self.peek().text != "in" else level

    def level_here(self) -> int:
        """How tight the operator is that stands here; 0 for none."""
        row = self.infix_here()
        return self.python_level_here() if row is None else row.level

    def climb(self, start: int, left: ast.Expression, level: int) -> ast.Expression:
        """Read the operators after a left operand, as long as they are tight enough."""
        while True:
            row = self.infix_here()
            here = self.python_level_here() if row is None else row.level
            if not here or here < level:
                return left
            if row is not None:
                left = self.phrase(start, row, left)
                if here == IMPLIES and self.text == "implies":
                    raise self.fail("`implies` twice in a row needs parentheses")
            elif here == COMPARISON:
                left = self.comparison(start, left)
            elif here in (OR, AND):
                left = self.boolean(start, left, here)
            else:
                left = self.arithmetic(start, left, here)

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

    def arithmetic(self, start: int, left: ast.Expression, level: int) -> ast.Expression:
        """Read one of Python's operators and its right operand."""
        operator = self.advance().text
        right = self.binary(SIGN if level == POWER else level + 1)
        symbol = cast('Literal["+", "-", "*", "/", "//", "%", "**", "<<", ">>", "&", "|", "^"]', operator)
        return ast.BinaryOp(self.span(start), symbol, left, right)

    def operand(self, level: int) -> ast.Expression:
        """Read what stands before, between or after operators; a class with specifiers is an instance."""
        token = self.token
        text = token.text
        row = self.prefix_here(level)
        if row is not None:
            return self.prefix(row, level)
        if text == "new" and self.peek().kind == "name" and self.names_class(self.index + 1):
            return self.new()
        if text == "not":
            if level > NOT:
                raise self.fail("`not` needs parentheses here", hint="put `not` and its operand in parentheses")
            self.advance()
            value = self.binary(NOT)
            return ast.UnaryOp(self.span(token.start), "not", value)
        if text in _SIGNS:
            self.advance()
            value = self.binary(SIGN)
            symbol: Literal["-", "+", "~"] = "-" if text == "-" else "+" if text == "+" else "~"
            return ast.UnaryOp(self.span(token.start), symbol, value)
        if text in ("await", "yield"):
            return self.unsupported()
        node = self.postfix(token.start, self.atom())
        is_name = token.kind == "name" and isinstance(node, ast.Name | ast.Attribute)
        if is_name and self.token.kind in ("name", "keyword") and self.starts_instance(node):
            return self.instance(token.start, node, keyword=False)
        return node

    def prefix_here(self, level: int = UNTIL) -> PhraseRow | None:
        """The operator that starts here with words, such as `distance to`.

        Args:
            level: How tight the operators around it are.
        """
        for row in PREFIXES_AT.get(self.text, ()):
            if self.reads(self.index, row.words) and self.is_operator(level):
                return row
        return None

    def is_operator(self, level: int) -> bool:
        """Whether a word that starts an operator is one here, and no name of the program's."""
        following = self.peek()
        is_name = following.text == "relative" and self.peek(2).text == "to"
        match self.text:
            case "not":
                return self.starts_operand(self.index + 2)
            case "follow":
                if following.text == "(":
                    after = min(self.closing(self.index + 1) + 1, len(self.tokens) - 1)
                    return self.tokens[after].text in ("from", "for", ".", "[", "(")
                return not is_name and following.kind == "name" and self.starts_operand(self.index + 1)
            case "visible":
                if following.text == "not":
                    return self.peek(2).text == "visible" and self.peek(3).text != "from"
                if following.text in _AFTER_VISIBLE:
                    return True
                return not is_name and following.kind == "name" and self.starts_operand(self.index + 1)
            case "always" | "eventually" | "next":
                # before a bracket or a sign only where a requirement may have one: `always -x < 3`, not `y > always(x)`
                if following.text in CLOSERS or following.text in _SIGNS:
                    return self.temporal and level <= NOT
                return not is_name and self.starts_operand(self.index + 1) and following.text != "*"
            case _:
                return True

    def prefix(self, row: PhraseRow, level: int) -> ast.Expression:
        """Read an operator that starts with words; each place is read only once."""
        if level > PREFIX == row.level:
            hint = "put the operator and its operands in parentheses"
            raise self.fail(f"the operator that starts with `{self.text}` needs parentheses here", hint=hint)
        index = self.index
        known = self.prefixes.get(index)
        if known is None:
            self.enter()
            node = self.phrase(self.token.start, row)
            self.depth -= 1
            self.prefixes[index] = known = node, self.index
        self.move(known[1])
        return known[0]

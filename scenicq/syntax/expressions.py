"""Expressions: operators by precedence climbing, Scenic's phrases by their rows, instances, operands, strings."""

from __future__ import annotations

import re
from bisect import bisect_right
from typing import Literal, Self, cast

from scenicq.errors import Note, ScenarioError, Source, similar
from scenicq.limits import LIMITS
from scenicq.syntax import ast
from scenicq.syntax.cursor import Cursor
from scenicq.syntax.hints import phrase_hint, specifier_hint
from scenicq.syntax.lexer import tokenize_part
from scenicq.syntax.literals import Field, LiteralText, decode, number_value, split_format, string_parts
from scenicq.syntax.phrases import (
    INFIX_NAMES,
    INFIX_WORDS,
    INFIXES_AT,
    PREFIXES_AT,
    SPECIFIERS,
    SPECIFIERS_AT,
    Operand,
    PhraseRow,
)
from scenicq.syntax.precedence import AND, COMPARISON, IMPLIES, NOT, OR, POWER, PREFIX, PYTHON, SIGN, UNION, UNTIL
from scenicq.syntax.tokens import CLOSERS, Token

__all__ = ["ExpressionParser"]

_JOINED = re.compile(r"\\(?:\r\n|\r|\n)")
_SIGNS = ("-", "+", "~")
_AFTER_VISIBLE = INFIX_NAMES | {"(", "[", "{", *_SIGNS}
"""With these an operand starts after `visible`, which is then no name."""
_NAMES = ["with", *(" ".join(row.words) for row in SPECIFIERS)]
_ENDS = frozenset((",", ")", "]", "}", ";", ":", "if", "else", "for", "and", "or", "from", "as"))

_VALUES = {"True": True, "False": False, "None": None}
_FOREIGN = {"&&": "write `and`", "||": "write `or`", "<>": "write `!=`", "++": "write `+= 1`"}
_ORDER = frozenset({"<", ">", "<=", ">=", "==", "!=", "="})
_FORMAT_LEVELS = 2


class ExpressionParser(Cursor):
    """Reads expressions.

    Attributes:
        temporal: Whether the expression is a requirement's, where `until` is an operator and `always (x)` no call.
        classes: Names that the program defines as classes.
        variables: Names that the program assigns to.
        has_new: Whether `new` is used, so that a name before `in` is a value and no class.
        prefixes: What was read at a place, and the place after it: no operator that starts with words is read twice.
        places: The places of a word, for `line_has`.
        retries: How many tokens were looked at in vain.
    """

    def __init__(self, source: Source, tokens: list[Token]) -> None:
        """Start at the first token."""
        super().__init__(source, tokens)
        self.temporal = False
        self.classes: set[str] = set()
        self.variables: set[str] = set()
        self.has_new = False
        self.prefixes: dict[int, tuple[ast.Phrase, int]] = {}
        self.places: dict[str, list[int]] = {}
        self.retries = 0

    def part(self, tokens: list[Token]) -> Self:
        """A parser of the same program for the tokens of a part of it."""
        part = type(self)(self.source, tokens)
        part.classes, part.variables, part.has_new = self.classes, self.variables, self.has_new
        return part

    def expressions(self) -> ast.Expression:
        """Read expressions separated by commas: a tuple where there is a comma."""
        start = self.token.start
        first = self.item()
        if self.text != ",":
            return first
        items = [first]
        while self.accept(","):
            if not self.starts_operand(self.index):
                break
            items.append(self.item())
        return ast.Tuple(self.span(start), tuple(items))

    def item(self) -> ast.Expression:
        """Read an expression or `*value`."""
        if self.text == "*":
            return self.starred()
        if self.text == "yield":
            return self.unsupported()
        return self.expression()

    def named(self) -> ast.Expression:
        """Read an expression, `*value` or `name := value`."""
        if self.token.kind == "name" and self.peek().text == ":=":
            token = self.advance()
            target = ast.Name(self.token_span(token), token.text)
            self.advance()
            value = self.expression()
            return ast.Walrus(self.span(token.start), target, value)
        return self.item() if self.text in ("*", "yield") else self.expression()

    def unsupported(self) -> ast.Expression:
        """Read past `yield ...` or `await ...`."""
        word = self.advance()
        self.accept("from")
        if self.starts_operand(self.index):
            self.expressions()
        return ast.UnsupportedExpression(self.span(word.start), word.text)

    def starts_operand(self, index: int) -> bool:
        """Whether an expression can start at the token."""
        token = self.tokens[index]
        match token.kind:
            case "number" | "string":
                return True
            case "name":
                return token.text not in INFIX_WORDS
            case "keyword":
                return token.text in ("not", "lambda", "await", "yield", "True", "False", "None")
            case "operator":
                return token.text in ("(", "[", "{", "-", "+", "~", "*", "...")
            case _:
                return False

    # --- operators

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

    # --- phrases, by their rows

    def phrase(self, start: int, row: PhraseRow, *left: ast.Expression) -> ast.Phrase:
        """Read a phrase from its words on.

        Args:
            start: Where it starts.
            row: The phrase.
            left: What stands before its words.
        """
        self.move(self.index + len(row.words))
        operands: list[ast.Expression | None] = [*left]
        place = self.token.start
        for part in row.rest:
            if isinstance(part, str):
                self.expect(part, f"after {row.after}", f"write `{row.example}`")
            elif part.word and not self.comes_to(part, place, operands):
                operands.append(None)
            else:
                place = self.token.start
                operands.append(self.binary(part.level) if part.level else self.expression())
        return ast.Phrase(self.span(start), row, tuple(operands))

    def comes_to(self, part: Operand, place: int, operands: list[ast.Expression | None]) -> bool:
        """Go past the word before an operand that may be left out, if it is there.

        Before the word stands any expression; without the word, the operand before it ends where a sum ends. So where
        a looser operator follows, read on only if that leads to the word.

        Args:
            part: The operand.
            place: Where the operand before it starts.
            operands: The operands so far.
        """
        if self.text != part.word:
            before = operands[-1] if part.level else None
            if before is None or (self.text != "if" and not self.level_here()):
                return False
            wide = self.read_on(place, before, part.word)
            if wide is None:
                return False
            operands[-1] = wide
        self.advance()
        return True

    def read_on(self, start: int, left: ast.Expression, word: str) -> ast.Expression | None:
        """Read looser operators after an operand, if that leads to the word."""
        if self.retries > LIMITS.reading_retries:
            raise self.fail(
                "the program has too many operators that can be read in several ways", code="budget-exceeded"
            )
        if not self.line_has(word):
            return None
        index, depth, temporal = self.index, self.depth, self.temporal
        try:
            node = self.conditional(start, self.climb(start, left, OR))
        except ScenarioError:
            node = None
        if node is not None and self.text == word:
            return node
        self.retries += max(0, self.index - index)
        self.move(index)
        self.depth, self.temporal = depth, temporal
        return None

    def line_has(self, word: str) -> bool:
        """Whether the word comes later in these brackets of this line."""
        places = self.places.get(word)
        if places is None:
            places = [index for index, token in enumerate(self.tokens) if token.text == word]
            self.places[word] = places
        following = bisect_right(places, self.index)
        last = places[following] if following < len(places) else 0
        depth = 0
        for index in range(self.index, last + 1):
            token = self.tokens[index]
            self.retries += 1
            if token.text in CLOSERS:
                depth += 1
            elif token.text in (")", "]", "}"):
                depth -= 1
                if depth < 0:
                    return False
            elif token.kind == "newline" or (not depth and token.text in (",", ";")):
                return False
        return bool(last)

    # --- instances: a class and its specifiers, with `new` or without

    def looks_like_class(self, node: ast.Expression) -> bool:
        """Whether a name is one of a class: defined as such, or in capitals as classes are."""
        match node:
            case ast.Name(id=name):
                if name in self.classes:
                    return True
                if name in self.variables:
                    return False
            case ast.Attribute(name=name):
                pass
            case _:
                return False
        return name[:1].isupper() and any(character.islower() for character in name)

    def starts_instance(self, node: ast.Expression) -> bool:
        """Whether the next tokens make a name the class of an instance without `new`."""
        if self.text == "with":
            return True
        if self.specifier_at(self.index) is None:
            return False
        if not self.level_here():
            return True
        # the words are an operator after a value, and a specifier after a class
        only_old = self.text not in ("at", "offset")
        return not (only_old and self.has_new) and self.looks_like_class(node)

    def specifier_at(self, index: int) -> PhraseRow | None:
        """The specifier that starts at the token, but for `with`."""
        for row in SPECIFIERS_AT.get(self.tokens[index].text, ()):
            # `toward` may be a variable
            if self.reads(index, row.words) and (
                row.words[-1] != "toward" or self.starts_operand(index + len(row.words))
            ):
                return row
        return None

    def starts_specifier(self, index: int) -> bool:
        """Whether a specifier starts at the token."""
        if self.tokens[index].text == "with":
            return self.tokens[min(index + 1, len(self.tokens) - 1)].kind == "name"
        row = self.specifier_at(index)
        if row is None:
            return False
        after = index + len(row.words)
        text = self.tokens[after].text
        if row.operands[0].word:
            return text in _ENDS or not text
        return len(row.words) > 1 or row.words == ("in",) or self.starts_operand(after) or text in INFIX_NAMES

    def names_class(self, index: int) -> bool:
        """Whether the name after `new` is that of a class, and not an operator after a variable called `new`."""
        if self.tokens[index].text in INFIX_NAMES:
            return self.starts_specifier(index + 1)
        return self.starts_operand(index)

    def new(self) -> ast.Expression:
        """Read `new Class specifiers`."""
        start = self.advance().start
        name = self.name("the class after `new`")
        cls: ast.Expression = ast.Name(self.token_span(name), name.text)
        while self.accept("."):
            name = self.name("the name of an attribute")
            cls = ast.Attribute(self.span(cls.span.start), cls, name.text, self.token_span(name))
        return self.instance(start, cls, keyword=True)

    def instance(self, start: int, cls: ast.Expression, *, keyword: bool) -> ast.Expression:
        """Read the specifiers of an instance of the class."""
        specifiers: list[ast.Specifier] = []
        temporal, self.temporal = self.temporal, False
        if keyword and self.opens_block():
            self.advance()
        if self.starts_specifier(self.index) or (self.token.text and not keyword):
            specifiers.append(self.specifier())
        elif self.token.kind == "name" and self.starts_operand(self.index):
            raise self.unknown()
        while specifiers and self.text == ",":
            if not self.starts_specifier(self.index + 1):
                self.advance()
                if self.is_unknown():
                    raise self.unknown()
                self.move(self.index - 1)
                break
            self.advance()
            specifiers.append(self.specifier())
        self.temporal = temporal
        span = self.span(start)
        several_lines = "\n" in span.text
        if several_lines and self.text == "," and self.peek().kind == "newline":
            self.advance()
        return ast.New(span, cls, tuple(specifiers), keyword)

    def opens_block(self) -> bool:
        """Whether a comma right after the class, outside brackets, puts all its specifiers on the lines below."""
        if self.text != "," or not self.starts_specifier(self.index + 1):
            return False
        comma, following = self.token, self.peek()
        between = _JOINED.sub("", self.source.text[comma.end : following.start])
        if "\n" not in between and "\r" not in between:
            return False
        depth, index = 0, self.index
        while index and depth <= 0 and self.tokens[index - 1].kind not in ("newline", "indent", "dedent"):
            index -= 1
            text = self.tokens[index].text
            depth += (text in CLOSERS) - (text in CLOSERS.values())
        return depth <= 0

    def is_unknown(self) -> bool:
        """Whether two words side by side can only be a misspelt specifier."""
        following = self.peek()
        if self.token.kind != "name" or not self.starts_operand(self.index) or self.text[:1].isupper():
            return False
        if following.kind == "name":
            return (
                self.starts_operand(self.index + 1) and bool(similar(self.text, _NAMES)) and self.prefix_here() is None
            )
        return following.kind in ("number", "string")

    def unknown(self) -> ScenarioError:
        """The error for a word that starts no specifier."""
        close = similar(self.text, _NAMES) or similar(f"{self.text} {self.peek().text}", _NAMES)
        if close.startswith(f"{self.text} "):
            message = f"`{self.text}` alone starts no specifier"
            return self.fail(message, hint=f"write `{close}`", code="unknown-specifier")
        hint = f"`{close}` is spelled similarly" if close else "a property is set by `with property value`"
        hint = specifier_hint(self.text) or hint
        return self.fail(f"no specifier starts with `{self.text}`", hint=hint, code="unknown-specifier")

    def specifier(self) -> ast.Specifier:
        """Read one specifier."""
        start = self.token.start
        if self.accept("with"):
            name = self.name("the name of the property")
            value = self.expression()
            return ast.WithSpecifier(self.span(start), name.text, self.token_span(name), value)
        row = self.specifier_at(self.index)
        if row is None:
            raise self.unknown()
        return self.phrase(start, row)

    # --- operands: names, numbers, displays, calls, subscripts

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

    # --- what gets a name: targets of assignments and loops, parameters

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

    # --- strings: plain, bytes, formatted, and several side by side

    def strings(self) -> ast.Expression:
        """Read adjacent string literals as one value."""
        start = self.token.start
        parts: list[ast.LiteralValue | ast.Replacement] = []
        formatted = False
        binary: bool | None = None
        while self.token.kind == "string":
            token = self.advance()
            prefix, begin, end = string_parts(token)
            if binary is not None and binary != ("b" in prefix):
                raise self.fail("strings and bytes stand side by side", self.token_span(token))
            binary = "b" in prefix
            raw = "r" in prefix
            if "f" in prefix:
                formatted = True
                parts += self.format_parts(begin, end, raw, _FORMAT_LEVELS)
            else:
                value = decode(self.source, begin, end, raw=raw, binary=binary)
                parts.append(ast.LiteralValue(self.token_span(token), value))
        span = self.span(start)
        if formatted:
            return ast.FormattedString(span, tuple(parts))
        text = "".join(str(part.value) for part in parts)
        if not binary:
            return ast.LiteralValue(span, text)
        if any(ord(character) > 255 for character in text) or not span.text.isascii():
            raise self.fail("bytes hold ASCII characters only", span)
        return ast.LiteralValue(span, text.encode("latin-1"))

    def format_parts(self, start: int, end: int, raw: bool, levels: int) -> list[ast.LiteralValue | ast.Replacement]:
        """Read the text and the fields of a formatted string."""
        if not levels:
            place = Token("string", "", start, end)
            raise self.fail("fields are nested too deeply in the formatted string", self.token_span(place))
        self.enter()
        parts: list[ast.LiteralValue | ast.Replacement] = []
        for piece in split_format(self.source, start, end, raw=raw):
            match piece:
                case LiteralText():
                    whole = Token("string", "", piece.start, piece.end)
                    parts.append(ast.LiteralValue(self.token_span(whole), piece.value))
                case Field():
                    parts += self.field(piece, raw, levels)
        self.depth -= 1
        return parts

    def field(self, field: Field, raw: bool, levels: int) -> list[ast.LiteralValue | ast.Replacement]:
        """Read one field of a formatted string."""
        begin, end = field.expression
        inner = self.part(tokenize_part(self.source, begin, end))
        inner.depth = self.depth
        value = inner.expressions()
        if inner.token.kind != "end":
            raise inner.fail(f"`{inner.text}` does not continue the expression")
        whole = Token("string", "", field.start, field.end)
        spec: ast.FormattedString | None = None
        if field.format is not None:
            place = Token("string", "", *field.format)
            spec = ast.FormattedString(self.token_span(place), tuple(self.format_parts(*field.format, raw, levels - 1)))
        replacement = ast.Replacement(self.token_span(whole), value, field.conversion, spec)
        if not field.shows_text:
            return [replacement]
        shown = self.source.text[begin:end] + "="
        return [ast.LiteralValue(self.token_span(Token("string", "", begin, end)), shown), replacement]

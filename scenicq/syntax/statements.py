"""Blocks, and Python's statements that have one."""

from __future__ import annotations

from abc import abstractmethod

from scenicq.syntax import ast
from scenicq.syntax.simple_statements import SimpleParser
from scenicq.syntax.tokens import Token

__all__ = ["StatementParser"]

_MODIFIERS = ("additive", "dynamic", "final")


class StatementParser(SimpleParser):
    """Reads blocks and the statements that Scenic shares with Python."""

    @abstractmethod
    def scenic_statement(self) -> ast.Statement | None:
        """Read one of Scenic's own statements with the end of its line, or nothing where none starts."""

    def body(self) -> tuple[ast.Statement, ...]:
        """Read all statements to the end of the text."""
        statements: list[ast.Statement] = []
        while self.token.kind != "end":
            if self.token.kind == "newline":
                self.advance()
                continue
            self.statement(statements, in_class=False)
        return tuple(statements)

    def block(self, header: str, *, in_class: bool = False) -> tuple[ast.Statement, ...]:
        """Read `:` and the indented statements after it, or the simple ones on the same line."""
        if self.text != ":":
            hint = "`==` compares" if self.text == "=" else ""
            raise self.fail(f"`:` is missing after {header}", label=self.found(), hint=hint)
        self.advance()
        statements: list[ast.Statement] = []
        start = self.token.kind
        if start != "newline":
            while not statements or not self.ended():
                self.simple(statements, in_class)
            return tuple(statements)
        self.advance()
        start = self.token.kind
        if start != "indent":
            raise self.fail(f"an indented block is missing after {header}", hint="write `pass` for an empty block")
        self.advance()
        while self.token.kind not in ("dedent", "end"):
            self.statement(statements, in_class)
        self.advance()
        return tuple(statements)

    def ended(self) -> bool:
        """Whether the line of the statement that was just read is over."""
        return self.tokens[self.index - 1].kind in ("newline", "dedent") or self.token.kind == "end"

    def statement(self, statements: list[ast.Statement], in_class: bool) -> None:
        """Read one statement, or the simple statements of one line."""
        if self.token.kind == "indent":
            raise self.fail("this line is indented more than the block it is in", hint="only after `:` a block starts")
        compound = self.compound()
        if compound is None:
            self.simple(statements, in_class)
        else:
            statements.append(compound)

    def simple(self, statements: list[ast.Statement], in_class: bool) -> None:
        """Read one simple statement and what ends it."""
        property_default = self.property_default() if in_class else None
        statement = property_default or self.scenic_statement() or self.small()
        statements.append(statement)
        if not self.ended():
            self.end_of_statement()

    def compound(self) -> ast.Statement | None:
        """Read a statement with a block, or nothing where none starts."""
        match self.text:
            case "if":
                return self.if_()
            case "for":
                return self.for_()
            case "while":
                return self.while_()
            case "def":
                return self.function(())
            case "class":
                return self.class_(())
            case "constructor" if self.peek().kind == "name" and self.peek(2).text in (":", "("):
                return self.class_(())
            case "@":
                return self.decorated()
            case "try":
                return self.try_()
            case "with":
                return self.with_()
            case "async":
                return self.skipped_statement("async")
            case "match" if self.is_match():
                return self.skipped_statement("match")
            case _:
                return None

    def is_match(self) -> bool:
        """Whether `match` starts a statement here: its block starts with `case`."""
        index = self.index
        while self.tokens[index].kind not in ("newline", "end"):
            index += 1
        after = self.tokens[index + 1 : index + 3]
        return self.tokens[index - 1].text == ":" and len(after) == 2 and after[1].text == "case"

    def skipped_statement(self, construct: str) -> ast.Statement:
        """Read past a statement that is not part of the language here."""
        start = self.token.start
        self.skip()
        return ast.UnsupportedStatement(self.span(start), construct)

    def skip(self) -> None:
        """Go past a statement with its block, whatever it holds."""
        while self.advance().kind not in ("newline", "end"):
            pass
        kind = self.token.kind
        if kind != "indent":
            return
        depth = 0
        while self.token.kind != "end":
            kind = self.advance().kind
            depth += (kind == "indent") - (kind == "dedent")
            if not depth:
                return

    def if_(self) -> ast.Statement:
        """Read `if`, `elif` and `else`."""
        start = self.token.start
        branches: list[ast.Branch] = []
        while self.text == "elif" or not branches:
            place = self.advance().start
            test = self.named()
            body = self.block("the condition")
            branches.append(ast.Branch(self.span(place), test, body))
        orelse = self.else_()
        return ast.If(self.span(start), tuple(branches), orelse)

    def else_(self) -> tuple[ast.Statement, ...]:
        """Read `else` and its block, if it is there."""
        if not self.accept("else"):
            return ()
        if self.text == "if":
            raise self.fail("`else` and `if` cannot stand side by side", hint="write `elif`")
        return self.block("`else`")

    def for_(self) -> ast.Statement:
        """Read a `for` loop."""
        start = self.advance().start
        target = self.targets()
        self.expect("in", "after the variable of the loop")
        iterable = self.expressions()
        body = self.block("the values of the loop")
        orelse = self.else_()
        return ast.For(self.span(start), target, iterable, body, orelse)

    def while_(self) -> ast.Statement:
        """Read a `while` loop."""
        start = self.advance().start
        test = self.named()
        body = self.block("the condition")
        orelse = self.else_()
        return ast.While(self.span(start), test, body, orelse)

    def decorated(self) -> ast.Statement:
        """Read decorators and what they decorate."""
        decorators: list[ast.Expression] = []
        while self.accept("@"):
            decorators.append(self.named())
            if self.token.kind != "newline":
                raise self.leftover()
            self.advance()
        if self.text == "def":
            return self.function(tuple(decorators))
        if self.text == "class":
            return self.class_(tuple(decorators))
        if self.text == "async":
            return self.skipped_statement("async")
        raise self.fail("a decorator stands before something other than a function or a class")

    def function(self, decorators: tuple[ast.Expression, ...]) -> ast.Statement:
        """Read a function."""
        start = self.advance().start
        name = self.name("the name of the function")
        self.expect("(", "after the name of the function")
        parameters = self.parameters(")")
        self.advance()
        returns = self.expression() if self.accept("->") else None
        body = self.block("the parameters")
        return ast.FunctionDef(
            self.span(start), name.text, self.token_span(name), parameters, returns, body, decorators
        )

    def class_(self, decorators: tuple[ast.Expression, ...]) -> ast.Statement:
        """Read a class."""
        start = self.advance().start
        name = self.name("the name of the class")
        bases = self.arguments() if self.text == "(" else ()
        body = self.block("the name of the class", in_class=True)
        return ast.ClassDef(self.span(start), name.text, self.token_span(name), bases, body, decorators)

    def property_default(self) -> ast.Statement | None:
        """Read `name: value` or `name[modifiers]: value`, or nothing where neither starts."""
        if self.token.kind != "name":
            return None
        modifiers: list[str] = []
        if self.peek().text == "[":
            closing = self.closing(self.index + 1)
            if self.tokens[min(closing + 1, len(self.tokens) - 1)].text != ":":
                return None
            name = self.advance()
            self.advance()
            while not modifiers or self.accept(","):
                if self.text not in _MODIFIERS:
                    raise self.fail(f"`{self.text}` is not a modifier", hint="write `additive`, `dynamic` or `final`")
                modifiers.append(self.advance().text)
            self.expect("]", "after the modifiers")
        elif self.peek().text == ":":
            name = self.advance()
        else:
            return None
        self.advance()
        value = self.expressions()
        return ast.PropertyDefault(self.span(name.start), name.text, self.token_span(name), tuple(modifiers), value)

    def try_(self) -> ast.Statement:
        """Read `try` and its handlers."""
        start = self.advance().start
        body = self.block("`try`")
        handlers: list[ast.ExceptHandler] = []
        if self.text == "interrupt" and self.peek().text == "when":
            while self.text in ("interrupt", "except", "else", "finally"):
                self.skip()
            return ast.DynamicStatement(self.span(start), "try/interrupt")
        while self.text == "except":
            place = self.advance().start
            self.accept("*")
            kind = None if self.at(":") else self.expressions()
            name = self.name("the name of the exception").text if self.accept("as") else None
            handler = self.block("the exception")
            handlers.append(ast.ExceptHandler(self.span(place), kind, name, handler))
        orelse = self.else_() if handlers else ()
        final = self.block("`finally`") if self.accept("finally") else ()
        if not handlers and not final:
            raise self.fail("`try` has neither `except` nor `finally`", self.token_span(self.token_at(start)))
        return ast.Try(self.span(start), body, tuple(handlers), orelse, final)

    def token_at(self, start: int) -> Token:
        """The token that starts at the offset, at or before this place."""
        index = self.index
        while index > 0 and self.tokens[index].start > start:
            index -= 1
        return self.tokens[index]

    def with_(self) -> ast.Statement:
        """Read a `with` statement."""
        start = self.advance().start
        parenthesised = False
        if self.text == "(":
            after = min(self.closing(self.index) + 1, len(self.tokens) - 1)
            parenthesised = self.tokens[after].text == ":"
        if parenthesised:
            self.advance()
        items: list[ast.WithItem] = []
        while not items or self.accept(","):
            if parenthesised and items and self.text == ")":
                break
            place = self.token.start
            context = self.expression()
            target: ast.Expression | None = None
            if self.accept("as"):
                begin = self.token.start
                target = self.postfix(begin, self.atom())
                self.check_target(target)
            items.append(ast.WithItem(self.span(place), context, target))
        if parenthesised:
            self.expect(")", "after the contexts")
        body = self.block("the context")
        return ast.WithStatement(self.span(start), tuple(items), body)

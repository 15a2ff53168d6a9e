"""Python's statements without a block."""

from __future__ import annotations

from typing import Literal, cast

from scenicq.errors import ScenarioError
from scenicq.syntax import ast
from scenicq.syntax.hints import phrase_hint
from scenicq.syntax.operators import OperatorParser

__all__ = ["SimpleParser"]

_AUGMENTED = frozenset(("+=", "-=", "*=", "/=", "//=", "%=", "**=", "<<=", ">>=", "&=", "|=", "^=", "@="))


class SimpleParser(OperatorParser):
    """Reads simple statements."""

    def end_of_statement(self) -> None:
        """Read `;` or the end of the line."""
        if self.accept(";"):
            if self.token.kind == "newline":
                self.advance()
            return
        if self.token.kind == "newline":
            self.advance()
        elif self.token.kind not in ("end", "dedent"):
            raise self.leftover()

    def leftover(self) -> ScenarioError:
        """The error for what does not belong to the statement before it."""
        before = self.tokens[self.index - 1].text
        hint = ""
        if self.is_unknown() and before[:1].isupper():
            return self.unknown()
        if self.text == "=":
            hint = "`==` compares"
        elif self.text and self.starts_specifier(self.index):
            hint = f"a comma separates specifiers: write `, {self.text} ...`"
            if before == ",":
                hint = "no comma stands between the class and its first specifier"
        else:
            hint = phrase_hint(self.tokens, self.index)
        message = f"`{self.text}` does not continue the statement" if self.text else "the statement is not complete"
        return self.fail(message, label="an operator or the end of the line can stand here", hint=hint)

    def small(self) -> ast.Statement:
        """Read one of Python's simple statements, without what ends it."""
        start = self.token.start
        match self.text:
            case "pass":
                self.advance()
                return ast.Pass(self.span(start))
            case "break":
                self.advance()
                return ast.Break(self.span(start))
            case "continue":
                self.advance()
                return ast.Continue(self.span(start))
            case "return":
                self.advance()
                value = None if self.at_line_end() else self.expressions()
                return ast.Return(self.span(start), value)
            case "del":
                self.advance()
                target = self.targets()
                targets = target.items if isinstance(target, ast.Tuple) and target.span.text[:1] != "(" else (target,)
                return ast.Delete(self.span(start), targets)
            case "assert":
                self.advance()
                test = self.expression()
                message = self.expression() if self.accept(",") else None
                return ast.Assert(self.span(start), test, message)
            case "raise":
                self.advance()
                exception = None if self.at_line_end() else self.expression()
                cause = self.expression() if exception is not None and self.accept("from") else None
                return ast.Raise(self.span(start), exception, cause)
            case "global":
                self.advance()
                names = self.names()
                return ast.Global(self.span(start), names)
            case "nonlocal":
                self.advance()
                names = self.names()
                return ast.Nonlocal(self.span(start), names)
            case "import":
                return self.import_()
            case "from":
                return self.import_from()
            case "else" | "elif" | "except" | "finally" as word:
                owner = "`if`" if word == "elif" else "`if`, `for`, `while` or `try`" if word == "else" else "`try`"
                raise self.fail(f"`{word}` belongs to no {owner}", label="none ends at this indentation")
            case _:
                return self.assignment()

    def names(self) -> tuple[ast.Name, ...]:
        """Read names separated by commas."""
        names: list[ast.Name] = []
        while not names or self.accept(","):
            token = self.name("the name of a variable")
            names.append(ast.Name(self.token_span(token), token.text))
        return tuple(names)

    def dotted(self, what: str) -> str:
        """Read `a.b.c`."""
        path = self.name(what).text
        while self.accept("."):
            path += "." + self.name("the next part of the path").text
        return path

    def import_(self) -> ast.Statement:
        """Read `import`."""
        start = self.advance().start
        aliases: list[ast.ImportAlias] = []
        while not aliases or self.accept(","):
            place = self.token.start
            path = self.dotted("the name of the module")
            name = self.name("the name after `as`").text if self.accept("as") else None
            aliases.append(ast.ImportAlias(self.span(place), path, name))
        return ast.Import(self.span(start), tuple(aliases))

    def import_from(self) -> ast.Statement:
        """Read `from ... import`."""
        start = self.advance().start
        level = 0
        while self.text in (".", "..."):
            level += len(self.advance().text)
        module = "" if level and self.text == "import" else self.dotted("the name of the module")
        self.expect("import", "after the name of the module")
        aliases: list[ast.ImportAlias] = []
        place = self.token.start
        if self.accept("*"):
            aliases.append(ast.ImportAlias(self.span(place), "*", None))
            return ast.ImportFrom(self.span(start), module, level, tuple(aliases))
        closed = self.accept("(")
        while not aliases or self.accept(","):
            if closed and aliases and self.text == ")":
                break
            place = self.token.start
            path = self.name("the name to import").text
            name = self.name("the name after `as`").text if self.accept("as") else None
            aliases.append(ast.ImportAlias(self.span(place), path, name))
        if closed:
            self.expect(")", "after the names to import")
        return ast.ImportFrom(self.span(start), module, level, tuple(aliases))

    def assignment(self) -> ast.Statement:
        """Read an assignment or an expression."""
        start = self.token.start
        value = self.expressions()
        if self.text == "=":
            targets: list[ast.Expression] = []
            while self.accept("="):
                self.check_target(value)
                targets.append(value)
                value = self.expressions()
            return ast.Assign(self.span(start), tuple(targets), value)
        if self.text in _AUGMENTED:
            return self.augmented(start, value)
        if self.text == ":" and isinstance(value, ast.Name | ast.Attribute | ast.Subscript):
            self.advance()
            annotation = self.expression()
            assigned = self.expressions() if self.accept("=") else None
            return ast.AnnotatedAssign(self.span(start), value, annotation, assigned)
        return ast.ExpressionStatement(self.span(start), value)

    def augmented(self, start: int, target: ast.Expression) -> ast.Statement:
        """Read an augmented assignment."""
        if not isinstance(target, ast.Name | ast.Attribute | ast.Subscript):
            raise self.fail("only a name, an attribute or an element can be changed", target.span)
        word = self.advance().text[:-1]
        operator = cast('Literal["+", "-", "*", "/", "//", "%", "**", "<<", ">>", "&", "|", "^", "@"]', word)
        value = self.expressions()
        return ast.AugmentedAssign(self.span(start), target, operator, value)

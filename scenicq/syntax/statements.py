"""Statements: blocks, Python's statements, and Scenic's own, whose words stay usable as names where they start none."""

from __future__ import annotations

from typing import Literal, cast

from scenicq.errors import ScenarioError, Span
from scenicq.syntax import ast
from scenicq.syntax.expressions import ExpressionParser
from scenicq.syntax.hints import phrase_hint
from scenicq.syntax.literals import decode, string_parts
from scenicq.syntax.phrases import INFIX_WORDS
from scenicq.syntax.precedence import POWER
from scenicq.syntax.tokens import CLOSERS, Token

__all__ = ["ProgramParser"]

_AUGMENTED = frozenset(("+=", "-=", "*=", "/=", "//=", "%=", "**=", "<<=", ">>=", "&=", "|=", "^=", "@="))
_MODIFIERS = ("additive", "dynamic", "final")
_NOT_AFTER_WORD = frozenset(
    ("=", ".", ",", ":", ";", ")", "]", "}", "", "+=", "-=", "*=", "/=", "//=", "%=", "**=", "<<=", ">>=", "&=", "|=",
     "^=", "@=", ":=", "==", "!=", "<", "<=", ">", ">=", "*", "/", "//", "%", "**", "@", "+", "&", "|", "^")
)  # fmt: skip
_DEFINITIONS = frozenset(("behavior", "monitor", "scenario"))
_BLOCKS = frozenset(("setup", "compose"))


class ProgramParser(ExpressionParser):
    """Reads whole programs."""

    guarded = False
    """Whether the body of a behavior, monitor or scenario is read: `precondition:` and `invariant:` may stand there."""

    # --- blocks, and Python's statements that have one

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
        if self.text == "interrupt" and self.peek().text == "when":
            return self.try_interrupt(start, body)
        handlers = self.handlers(start, needed=True)
        return ast.Try(self.span(start), body, *handlers)

    def try_interrupt(self, start: int, body: tuple[ast.Statement, ...]) -> ast.Statement:
        """Read what follows the body of a `try` that may be interrupted."""
        interrupts: list[ast.Interrupt] = []
        while self.text == "interrupt" and self.peek().text == "when":
            place = self.advance().start
            self.advance()
            condition = self.expression()
            interrupts.append(ast.Interrupt(self.span(place), condition, self.block("the condition")))
        handlers = self.handlers(start, needed=False)
        return ast.TryInterrupt(self.span(start), body, tuple(interrupts), *handlers)

    def handlers(
        self, start: int, *, needed: bool
    ) -> tuple[tuple[ast.ExceptHandler, ...], tuple[ast.Statement, ...], tuple[ast.Statement, ...]]:
        """Read `except`, `else` and `finally` of a `try`."""
        handlers: list[ast.ExceptHandler] = []
        while self.text == "except":
            place = self.advance().start
            self.accept("*")
            kind = None if self.at(":") else self.expressions()
            name = self.name("the name of the exception").text if self.accept("as") else None
            handler = self.block("the exception")
            handlers.append(ast.ExceptHandler(self.span(place), kind, name, handler))
        orelse = self.else_() if handlers else ()
        final = self.block("`finally`") if self.accept("finally") else ()
        if needed and not handlers and not final:
            raise self.fail("`try` has neither `except` nor `finally`", self.token_span(self.token_at(start)))
        return tuple(handlers), orelse, final

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

    # --- simple statements

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

    # --- Scenic's own

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
            case word if (
                word in _BLOCKS and self.peek().text == ":" and (self.guarded or self.peek(2).kind == "newline")
            ):
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
        """Read a behavior, monitor or scenario, or one of the blocks of a scenario."""
        start = self.advance().start
        name = self.advance().text if kind in _DEFINITIONS else ""
        parameters: tuple[ast.Parameter, ...] = ()
        if kind in _DEFINITIONS and self.accept("("):
            parameters = self.parameters(")")
            self.advance()
        header = Span(self.source, start, self.token.end)
        around, self.guarded = self.guarded, True
        body = self.block(f"the header of the {kind}")
        self.guarded = around
        return ast.DynamicDefinition(header, kind, name, parameters, body)

    def override(self) -> ast.Statement:
        """Read `override object specifiers`."""
        start = self.advance().start
        target = self.postfix(self.token.start, self.atom())
        specifiers = [self.specifier()]
        while self.accept(","):
            if self.at_line_end():
                break
            specifiers.append(self.specifier())
        return ast.Override(self.span(start), target, tuple(specifiers))

    def guard(self, kind: str) -> ast.Statement:
        """Read `precondition: condition` or `invariant: condition`."""
        start = self.advance().start
        self.advance()
        return ast.DynamicStatement(self.span(start), kind, self.expression())

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

    def do(self) -> ast.Statement:
        """Read `do`, or its older name `invoke`."""
        start = self.advance().start
        schedule = self.advance().text if self.text in ("choose", "shuffle") else ""
        behaviors = self.several()
        until = duration = None
        unit = ""
        if self.accept("until"):
            until = self.expression()
        elif self.accept("for"):
            duration = self.expression()
            unit = self.unit()
        return ast.Do(self.span(start), behaviors, schedule, until, duration, unit)

    def take(self) -> ast.Statement:
        """Read `take`."""
        start = self.advance().start
        actions = self.several()
        return ast.Take(self.span(start), actions)

    def several(self) -> tuple[ast.Expression, ...]:
        """Read expressions separated by commas, the last of which may follow them."""
        found: list[ast.Expression] = []
        while not found or self.accept(","):
            if found and self.at_line_end():
                break
            found.append(self.expression())
        return tuple(found)

    def record(self, kind: str) -> ast.Statement:
        """Read `record`, `record initial` or `record final`."""
        start = self.advance().start
        if kind != "record":
            self.advance()
        operand = self.expression()
        manners: list[str] = []
        for word in ("every", "after") if kind == "record" else ():
            if self.accept(word):
                manners.append(word)
                self.expression()
                self.unit()
        name = self.name_after("value") or ""
        if kind == "record" and self.accept("to"):
            manners.append("to")
            self.expression()
        return ast.DynamicStatement(self.span(start), kind, operand, name=name, manners=tuple(manners))

    def unit(self) -> str:
        """Read the unit of a time."""
        if self.text not in ("seconds", "steps"):
            raise self.fail("`seconds` or `steps` is missing", label=self.found())
        return self.advance().text

    def dynamic(self, word: str) -> ast.Statement | None:
        """Read a statement about what happens over time, or nothing where none starts."""
        kind = self.dynamic_kind(word, self.peek().text)
        if not kind:
            return None
        if kind.startswith("terminate "):
            return self.terminate(kind)
        if kind in ("wait for", "wait until"):
            return self.wait(kind)
        if kind in ("precondition", "invariant"):
            return self.guard(kind)
        if word in ("do", "invoke"):
            return self.do()
        if word == "take":
            return self.take()
        if word == "override":
            return self.override()
        if kind.startswith("record"):
            return self.record(kind)
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
            case "precondition" | "invariant":
                return word if self.guarded and following == ":" else ""
            case _:
                return ""

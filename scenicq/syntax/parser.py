"""The way from text to tree."""

from __future__ import annotations

from itertools import pairwise

from scenicq.errors import Diagnostic, ScenarioError, Source
from scenicq.limits import LIMITS
from scenicq.syntax import ast
from scenicq.syntax.jumps import check_jumps
from scenicq.syntax.lexer import tokenize
from scenicq.syntax.phrases import INFIX_WORDS, VERSIONS
from scenicq.syntax.statements import ProgramParser
from scenicq.syntax.tokens import Token
from scenicq.syntax.versions import choose_version, find_evidence
from scenicq.syntax.walk import check_height

__all__ = ["parse"]


def parse(source: Source, version: int | None = None) -> ast.Program:
    """Read a Scenic program.

    Args:
        source: The text.
        version: 1 (the 2019 paper), 2 or 3; without it, what the syntax tells.

    Raises:
        ScenarioError: One diagnostic: `parse-error`, `unknown-specifier`, `mixed-versions`, or `budget-exceeded` for a
            text that is too long or nested too deeply.
        ValueError: There is no such version.
    """
    if version is not None and version not in VERSIONS:
        message = f"version {version} is none of {sorted(VERSIONS)}"
        raise ValueError(message)
    if len(source.text) > LIMITS.program_characters:
        message = f"`{source.name}` is longer than {LIMITS.program_characters:,} characters"
        raise ScenarioError(Diagnostic("budget-exceeded", message))
    tokens = tokenize(source)
    parser = ProgramParser(source, tokens)
    _see_names(parser, tokens)
    parser.has_new = version == 3 or (version is None and _has_new(tokens))
    try:
        body = parser.body()
    except RecursionError:
        # The caller's own stack may leave less room than the limits of the parser need.
        error = parser.fail("the program is nested too deeply", code="budget-exceeded")
        raise error from None
    check_height(body)
    check_jumps(body)
    evidence = find_evidence(source, body, parser.classes | parser.variables)
    versions, chosen = choose_version(evidence, version)
    return ast.Program(source, body, versions, chosen, evidence)


def _see_names(parser: ProgramParser, tokens: list[Token]) -> None:
    """Note the names that the program uses for classes, functions and variables."""
    for before, token, after in zip([tokens[0], *tokens], tokens, tokens[1:], strict=False):
        if token.kind != "name":
            continue
        if before.text in ("class", "constructor"):
            parser.classes.add(token.text)
        elif before.text in ("def", "for", "as") or after.text == "=":
            parser.variables.add(token.text)


def _has_new(tokens: list[Token]) -> bool:
    pairs = pairwise(tokens)
    return any(a.text == "new" and b.kind == "name" and b.text not in INFIX_WORDS for a, b in pairs)

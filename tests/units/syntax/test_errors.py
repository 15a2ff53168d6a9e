"""What is said about programs that are no programs: facts in the user's words, at the exact place."""

from __future__ import annotations

import pytest

from .shape import error

GOLDEN = {
    "x = (1, 2\ny = 3": """\
error[parse-error]: `(` is never closed
 --> test.scenic:1:5
  |
1 | x = (1, 2
  |     ^ `)` is missing""",
    "x = [1}": """\
error[parse-error]: `}` does not close `[`
 --> test.scenic:1:7
  |
1 | x = [1}
  |       ^
  |
1 | x = [1}
  |     - this needs `]`""",
    "x = 1)": """\
error[parse-error]: `)` closes nothing
 --> test.scenic:1:6
  |
1 | x = 1)
  |      ^ no bracket is open here""",
    "if x = 3:\n    y": """\
error[parse-error]: `:` is missing after the condition
 --> test.scenic:1:6
  |
1 | if x = 3:
  |      ^ found `=`
  = hint: `==` compares""",
    "if x\n    y": """\
error[parse-error]: `:` is missing after the condition
 --> test.scenic:1:5
  |
1 | if x
  |     ^ the line ends here""",
    "if x:\ny": """\
error[parse-error]: an indented block is missing after the condition
 --> test.scenic:2:1
  |
2 | y
  | ^
  = hint: write `pass` for an empty block""",
    "x = 1\n  y = 2": """\
error[parse-error]: this line is indented more than the block it is in
 --> test.scenic:2:1
  |
2 |   y = 2
  | ^^
  = hint: only after `:` a block starts""",
    "if x:\n    y\n  z": """\
error[parse-error]: the indentation fits no open block
 --> test.scenic:3:1
  |
3 |   z
  | ^^ no line above starts a block here""",
    "x = 3 +": """\
error[parse-error]: an expression is missing
 --> test.scenic:1:8
  |
1 | x = 3 +
  |        ^ the line ends here""",
    "x = a b": """\
error[parse-error]: `b` does not continue the statement
 --> test.scenic:1:7
  |
1 | x = a b
  |       ^ an operator or the end of the line can stand here""",
    "x = a && b": """\
error[parse-error]: `&` cannot start an expression
 --> test.scenic:1:8
  |
1 | x = a && b
  |        ^ an expression is missing here
  = hint: write `and`""",
    "x = f(a b)": """\
error[parse-error]: a comma or the closing bracket is missing between arguments
 --> test.scenic:1:9
  |
1 | x = f(a b)
  |         ^ found `b`""",
    "x = [a,\n  b c]": """\
error[parse-error]: a comma or the closing bracket is missing between values
 --> test.scenic:2:5
  |
2 |   b c]
  |     ^ found `c`
  |
1 | x = [a,
  |     - this bracket is open""",
    "for = 3": """\
error[parse-error]: `=` cannot start an expression
 --> test.scenic:1:5
  |
1 | for = 3
  |     ^ an expression is missing here""",
    "def class(): pass": """\
error[parse-error]: `class` cannot be the name of the function
 --> test.scenic:1:5
  |
1 | def class(): pass
  |     ^^^^^ this word is reserved""",
    "else: x": """\
error[parse-error]: `else` belongs to no `if`, `for`, `while` or `try`
 --> test.scenic:1:1
  |
1 | else: x
  | ^^^^ none ends at this indentation""",
    "if a: b\nelse if c: d": """\
error[parse-error]: `else` and `if` cannot stand side by side
 --> test.scenic:2:6
  |
2 | else if c: d
  |      ^^
  = hint: write `elif`""",
    "x = \u201ca\u201d": """\
error[parse-error]: the character `\u201c` has no meaning here
 --> test.scenic:1:5
  |
1 | x = \u201ca\u201d
  |     ^
  = hint: write `"`""",
    "x = 1 \u2212 2": """\
error[parse-error]: the character `\u2212` has no meaning here
 --> test.scenic:1:7
  |
1 | x = 1 \u2212 2
  |       ^
  = hint: write `-`""",
    "x = Car at y, \\ \n  facing z": """\
error[parse-error]: a backslash stands before something other than the end of the line
 --> test.scenic:1:15
  |
1 | x = Car at y,""".replace("y,", "y, \\ ").rstrip()
    + """ \n  |               ^
  = hint: nothing may follow it, not even a space""",
    "x = !a": """\
error[parse-error]: `!` is not an operator
 --> test.scenic:1:5
  |
1 | x = !a
  |     ^
  = hint: write `not`""",
    "x = a if b": """\
error[parse-error]: `else` is missing after the condition
 --> test.scenic:1:11
  |
1 | x = a if b
  |           ^ the line ends here
  = hint: write `value if condition else other`""",
    "require (distance from ego x) < 3": """\
error[parse-error]: a comma or the closing bracket is missing between the parts of this expression
 --> test.scenic:1:28
  |
1 | require (distance from ego x) < 3
  |                            ^ found `x`""",
    "x = 1 + distance to y": """\
error[parse-error]: the operator that starts with `distance` needs parentheses here
 --> test.scenic:1:9
  |
1 | x = 1 + distance to y
  |         ^^^^^^^^
  = hint: put the operator and its operands in parentheses""",
}


@pytest.mark.parametrize("text", GOLDEN)
def test_message(text: str) -> None:
    assert error(text) == GOLDEN[text]


@pytest.mark.parametrize(
    ("text", "message"),
    {
        "try:\n  a\nb": "`try` has neither `except` nor `finally`",
        "def f(a, a): pass": "two parameters are called `a`",
        "def f(a=1, b): pass": "`b` needs a default, as the one before it has",
        "def f(**a, b): pass": "nothing can follow the parameter with `**`",
        "f(x for x in y, 1)": "a generator beside other arguments needs parentheses",
        "(*a)": "a star is of no use in parentheses without a comma",
        "[x async for x in y]": "a comprehension cannot be asynchronous",
        "{1: 2, 3}": "`:` is missing after the key",
        "x[]": "an index is missing between the brackets",
        "@a\nx = 1": "a decorator stands before something other than a function or a class",
        "class C:\n  a[odd]: 1": "`odd` is not a modifier",
        "from a import": "the name to import is missing",
        "import": "the name of the module is missing",
        "x.": "the name of an attribute is missing",
        "x = a implies b": "`implies` does not continue the statement",
        "require a implies b implies c": "`implies` twice in a row needs parentheses",
        "x = 1 + not y": "`not` needs parentheses here",
        "x = 1 + lambda: 2": "a lambda needs parentheses here",
        "if x:\n\ty\n        z": "the indentation mixes tabs and spaces",
        "x\x00": "the character U+0000 has no meaning here",
    }.items(),
)
def test_fact(text: str, message: str) -> None:
    assert message in error(text)

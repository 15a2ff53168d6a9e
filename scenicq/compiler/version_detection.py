"""Which version of Scenic a program is written for, where its syntax leaves several possible.

The syntax alone does not tell `(1, 3)` the interval (the 2019 paper) from `(1, 3)` the vector (Scenic 2 and 3), nor a
class that is named from one that is made an instance; their use does.
"""

from __future__ import annotations

from scenicq.compiler.environment import FIRST_LIBRARIES
from scenicq.syntax import ast, phrases
from scenicq.syntax.walk import walk

__all__ = ["decide_version"]

_FIRST_FUNCTIONS = frozenset({"createPlatoonAt", "carAheadOfCar"})
"""Functions of the 2019 paper's library: they take no vectors."""
_SCALAR_PROPERTIES = frozenset(
    {"width", "length", "height", "roadDeviation", "heading", "speed", "viewAngle", "visibleDistance"}
)


def decide_version(module: ast.Program) -> int:
    """The version that a program is read as.

    Where several fit: a library of the 2019 paper or an interval decides for Scenic 1, a class that stands alone for
    Scenic 2, else the newest counts.
    """
    possible = module.versions
    if module.version is not None or len(possible) == 1:
        return module.version or next(iter(possible))
    if 1 in possible and (_imports_first_library(module) or _has_interval(module)):
        return 1
    if 2 in possible and any(_stands_alone(statement, module) for statement in walk(*module.body)):
        return 2
    return max(possible)


def _imports_first_library(module: ast.Program) -> bool:
    return any(
        isinstance(statement, ast.Import) and any(alias.path in FIRST_LIBRARIES for alias in statement.aliases)
        for statement in module.body
    )


def _stands_alone(statement: ast.SyntaxNode, module: ast.Program) -> bool:
    """Whether a statement is a bare name, as in `Car` or `ego = Car`: only the early versions have a use for it."""
    match statement:
        case ast.ExpressionStatement(value=ast.Name()):
            return True
        case ast.Assign(targets=(ast.Name(id="ego"),), value=ast.Name(id=name)):
            return name[:1].isupper()
        case _:
            return False


def _is_pair(node: ast.SyntaxNode | None) -> bool:
    return isinstance(node, ast.Tuple) and len(node.items) == 2 and node.span.text.startswith("(")


def _has_interval(module: ast.Program) -> bool:
    """Whether a pair of numbers, or a name for one, stands where only a number can."""
    named = {
        target.id
        for statement in walk(*module.body)
        if isinstance(statement, ast.Assign) and _is_pair(statement.value)
        for target in statement.targets
        if isinstance(target, ast.Name)
    }
    named |= {
        p.name
        for f in walk(*module.body)
        if isinstance(f, ast.FunctionDef)
        for p in f.parameters
        if _is_pair(p.default)
    }
    if _calls_first_library(module):
        return True
    named |= _given_pairs(module)

    def interval(node: ast.SyntaxNode | None) -> bool:
        return _is_pair(node) or (isinstance(node, ast.Name) and node.id in named)

    return any(interval(part) for node in walk(*module.body) for part in _number_places(node)) or any(
        isinstance(node, ast.Tuple) and _is_pair(node) and any(ast.is_phrase(item, phrases.DEG) for item in node.items)
        for node in walk(*module.body)
    )


def _calls_first_library(module: ast.Program) -> bool:
    """Whether a function of the 2019 paper's library is given a pair, as in `createPlatoonAt(car, 6, dist=(2, 8))`."""
    return any(
        isinstance(call, ast.Call)
        and isinstance(call.function, ast.Name)
        and call.function.id in _FIRST_FUNCTIONS
        and any(_is_pair(argument.value) for argument in call.arguments)
        for call in walk(*module.body)
    )


def _given_pairs(module: ast.Program) -> set[str]:
    """Parameters of the program's functions that some call gives a pair."""
    functions = {node.name: node.parameters for node in walk(*module.body) if isinstance(node, ast.FunctionDef)}
    found: set[str] = set()
    for call in walk(*module.body):
        if not (isinstance(call, ast.Call) and isinstance(call.function, ast.Name)):
            continue
        parameters = functions.get(call.function.id, ())
        for number, argument in enumerate(call.arguments):
            if argument.name is not None:
                found |= {argument.name} if _is_pair(argument.value) else set()
            elif _is_pair(argument.value) and number < len(parameters):
                found.add(parameters[number].name)
    return found


def _number_places(node: ast.SyntaxNode) -> tuple[ast.SyntaxNode | None, ...]:
    """The operands of a node that must be numbers."""
    match node:
        case ast.BinaryOp(operator="*" | "/"):
            return (node.left, node.right)
        case ast.UnaryOp(operator="-"):
            return (node.operand,)
        case ast.Call(function=ast.Name(id="resample"), arguments=(argument,)):
            return (argument.value,)
        case ast.WithSpecifier() if node.property in _SCALAR_PROPERTIES:
            return (node.value,)
        case ast.Phrase():
            return tuple(node.of_kind("number", "heading"))
        case ast.PropertyDefault() if node.name in _SCALAR_PROPERTIES:
            return (node.value,)
        case _:
            return ()

"""The modules that a program sees over one map, and the statements that import them.

Names are resolved as Python resolves them: a folder is a package, whose `__init__.scenic` is run first, leading dots
go up from the package of the file that has them, and a module that is still being read is there with what it has.
"""

from __future__ import annotations

from scenicq.compiler.builtins import language_names
from scenicq.compiler.contracts import ACTIONS, BEHAVIORS
from scenicq.compiler.coroutines import LibraryName
from scenicq.compiler.environment import FIRST_LIBRARIES, Environment
from scenicq.compiler.imported_files import ImportedFiles, Loader, absolute, packages
from scenicq.compiler.interpreter import Interpreter
from scenicq.compiler.label_questions import LABELS, question_names
from scenicq.compiler.models import (
    is_dynamic,
    is_package,
    libraries_of,
    library_text,
    members_of,
    network_names,
    plain_module,
    unsupported_module,
)
from scenicq.compiler.operations import operator_functions
from scenicq.compiler.roots import root_classes
from scenicq.compiler.sequences import sequence_functions
from scenicq.compiler.unread import NoValue
from scenicq.compiler.values import Builtin, Instance, ModelValue, Module, fail
from scenicq.errors import Diagnostic, Note, ScenarioError, Span, similar
from scenicq.forest.nodes import PAST, Feature, Node
from scenicq.geometry.network import Network
from scenicq.syntax import ast

__all__ = ["Modules"]


class Modules:
    """The names and modules that a program sees, over one map.

    Attributes:
        interpreter: Runs the program and what it imports.
        base: The names of the language.
    """

    def __init__(
        self, network: Network, version: int, initial: bool, loader: Loader | None, *, map_defaults: bool
    ) -> None:
        """Take the map, the version of Scenic, whether dynamic parts are ignored, and what reads files.

        Args:
            network: The map.
            version: The version of Scenic.
            initial: Whether dynamic parts are ignored.
            loader: Reads files.
            map_defaults: See `library_text`.
        """
        self._map_defaults = map_defaults
        self.interpreter = Interpreter(version, initial, self._import, network)
        functions = sequence_functions(self.interpreter) | operator_functions(self.interpreter)
        names = language_names() | functions | root_classes(version)
        self.base = Environment(names)
        self._network = network
        self._files = ImportedFiles(loader, version)
        self._modules: dict[str, Module] = {}
        self._unfinished: set[str] = set()

    def load(self, name: str, span: Span) -> Module:
        """The module of a dotted name, after the packages that it lies in.

        Raises:
            ScenarioError: unknown-model; what is wrong in the module.
        """
        if is_dynamic(name):
            self.interpreter.dynamic(f"import of {name}", span)
            return Module(name, {}, dynamic=True)
        for each in packages(name):
            if each not in self._modules:
                module = self._run_file(each, span) or self._model(each) or self._package(each)
                self._modules[each] = module = module or plain_module(each if each == name else name, span)
                package, _, last = each.rpartition(".")
                if package:
                    self._modules[package].names[last] = module
        return self._modules[name]

    def is_model_named(self, program: ast.Program) -> bool:
        """Whether a program, or a file that it imports, names a world model; Python's own modules are none."""
        return any(file is None and bool(libraries_of(name)) for name, file in self._files.reach(program))

    def _import(self, node: ast.Import | ast.ImportFrom | ast.Model, scope: Environment) -> None:
        """Run an `import`, `from ... import` or `model` statement; `scope` takes the names.

        Raises:
            ScenarioError: unknown-model, unknown-name.
        """
        match node:
            case ast.Model():
                scope.names.update(_public(self.load(node.name, node.name_span)))
            case ast.Import():
                for alias in node.aliases:
                    if (error := self._unsupported(alias.path, alias.span)) is not None:
                        scope.set(alias.name or alias.path.partition(".")[0], NoValue(error))
                    else:
                        self._import_module(alias, scope)
            case ast.ImportFrom():
                error = None if node.level else self._unsupported(node.module, node.span)
                if error is None:
                    return self._import_from(node, scope)
                for alias in node.aliases:
                    scope.set(alias.name or alias.path, NoValue(error))

    def _unsupported(self, name: str, span: Span) -> ScenarioError | None:
        """What is wrong with reading a name that comes from one of Python's modules; a file of that name goes first."""
        return None if self._is_there(name) else unsupported_module(name, span)

    def _import_module(self, alias: ast.ImportAlias, scope: Environment) -> None:
        module = self.load(alias.path, alias.span)
        if alias.name:
            scope.set(alias.name, module)
            return
        first = alias.path.partition(".")[0]
        scope.set(first, self._modules.get(first, module))
        if self.interpreter.version == 1 and module.name in FIRST_LIBRARIES:
            # the 2019 paper's `import gtaLib` gives the names themselves
            scope.names.update(module.names)

    def _import_from(self, node: ast.ImportFrom, scope: Environment) -> None:
        name = absolute(node.module, node.level, scope.package)
        if name is None:
            raise fail("unknown-model", "these dots lead out of the package of this file", node.span, "no package here",
                       ("a file beside the program is imported by its name, without a dot",))  # fmt: skip
        module = self.load(name, node.span)
        for alias in node.aliases:
            if alias.path == "*":
                scope.names.update(_public(module))
            elif module.dynamic:
                scope.set(alias.name or alias.path, self._library_name(alias.path))
            else:
                scope.set(alias.name or alias.path, self._member(module, alias))

    def _library_name(self, name: str) -> ModelValue:
        """What a name of a module of behaviors and actions stands for, where behaviors are followed; else nothing."""
        timed = self.interpreter.timed
        followed = timed is not None and timed.behaviors != "ignore"
        return LibraryName(name, name not in BEHAVIORS) if followed else None

    def _member(self, module: Module, alias: ast.ImportAlias) -> ModelValue:
        """What `from module import member` gives: a name of the module, else a module in its package."""
        if alias.path in module.names:
            return module.names[alias.path]
        inner = f"{module.name}.{alias.path}"
        if inner in self._modules or self._is_there(inner):
            return self.load(inner, alias.span)
        if module.name in self._unfinished:
            raise fail("unknown-name", f"`{module.name}` has no `{alias.path}` yet: it is imported in a circle",
                       alias.span, "not found",
                       (f"`import {module.name}` takes its names when they are used",))  # fmt: skip
        close = similar(alias.path, {*module.names, *members_of(module.name)})
        raise fail("unknown-name", f"`{module.name}` has no `{alias.path}`", alias.span, "not found",
                   (f"it has `{close}`",) if close else ())  # fmt: skip

    def _is_there(self, name: str) -> bool:
        known = is_dynamic(name) or is_package(name) or bool(libraries_of(name)) or name == LABELS
        return known or self._files.find(name) is not None

    def _model(self, name: str) -> Module | None:
        if name == LABELS:
            return Module(name, question_names(self.interpreter))
        files = libraries_of(name)
        if not files:
            return None
        records = {"_record": Builtin("_record", _record), "_module": Builtin("_module", _module),
                   "_unknown": Builtin("_unknown", _unknown)}  # fmt: skip
        scope = Environment(network_names(self._network, files[-1]) | records, self.base, library=True)
        for file in files:
            self.interpreter.run(library_text(file, map_defaults=self._map_defaults).body, scope)
        names = {name: self._library_name(name) for name in ACTIONS | BEHAVIORS}
        return Module(name, names | {key: value for key, value in scope.names.items() if not key.startswith("_")})

    def _package(self, name: str) -> Module | None:
        """A package without an `__init__`, which has no names but those of its modules."""
        return Module(name, {}) if is_package(name) or self._files.is_folder(name) else None

    def _run_file(self, name: str, span: Span) -> Module | None:
        try:
            file = self._files.find(name)
            if file is None:
                return None
            self.interpreter.budget.step(span, len(file.program.source.text))
            scope = Environment({}, self.base, package=file.package)
            module = self._modules[name] = Module(name, scope.names)
            self._unfinished.add(name)
            self.interpreter.run(file.program.body, scope)
        except ScenarioError as error:
            first = error.diagnostics[0]
            note = Note(span, "imported here")
            raise ScenarioError(
                Diagnostic(first.code, first.message, first.span, first.label, (*first.notes, note), first.hints)
            ) from None
        self._unfinished.discard(name)
        return module


def _public(module: Module) -> dict[str, ModelValue]:
    """The names that `from module import *` takes."""
    return {name: value for name, value in module.names.items() if not name.startswith("_")}


def _unknown(span: Span, what: str, owner: ModelValue = None, *more: ModelValue) -> Node:
    """Something that no label says, one for all its arguments."""
    index = owner.index if isinstance(owner, Instance) and owner.index is not None else 0
    words = " ".join(str(each) if isinstance(each, int | float | str) else str(id(each)) for each in (what, *more))
    return Feature(index, f"{PAST}{words}", "other", current=True, span=span)


def _record(_: Span, name: str, width: float, length: float) -> Module:
    return Module(name, {"name": name, "width": width, "length": length, "height": length})


def _module(_: Span, name: str, names: dict[str, ModelValue], call: ModelValue = None) -> Module:
    return Module(name, names, call=call)

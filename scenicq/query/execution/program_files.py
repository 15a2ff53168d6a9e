"""Programs read from files, and the files that they import."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from scenicq.compiler.imported_files import ImportedFiles
from scenicq.errors import DataError, Diagnostic, ScenarioError, Source
from scenicq.syntax.parser import parse

__all__ = ["SiblingFiles", "program_text", "read_program"]


def read_program(path: str | Path) -> Source:
    """Read a scenario.

    Raises:
        DataError: file-missing, or file-invalid where it is not UTF-8 text.
    """
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise DataError(Diagnostic("file-missing", f"{path} cannot be read: {error.strerror}")) from None
    try:
        return Source(str(path), data.decode("utf-8-sig"))
    except UnicodeDecodeError:
        raise DataError(Diagnostic("file-invalid", f"{path} is not text in UTF-8")) from None


@dataclass(eq=False)
class SiblingFiles:
    """What reads the files that a program imports: those in its own folder, nothing else, and each once.

    So whoever has it, copies in other processes included, compiles one program, whatever is written meanwhile.

    Attributes:
        path: The program's file.
    """

    path: Path
    _found: dict[str, Source | None] = field(default_factory=dict[str, "Source | None"], repr=False)

    def __call__(self, name: str) -> Source | None:
        """The text of a file of the folder; see `Loader`.

        Raises:
            DataError: file-missing or file-invalid.
        """
        if name not in self._found:
            self._found[name] = self._read(name)
        return self._found[name]

    def _read(self, name: str) -> Source | None:
        folder = self.path.resolve().parent
        file = (folder / name).resolve()
        if not file.is_relative_to(folder):
            return None
        if name.endswith("/"):
            return Source(str(file), "") if file.is_dir() else None
        return read_program(file) if file.is_file() else None


def program_text(source: Source, files: SiblingFiles, version: int | None) -> str:
    """The text of a program and of all files that it imports: where one of them differs, the program is another.

    Args:
        source: The program.
        files: What reads its files.
        version: The version of Scenic, if it is known.
    """
    imported = ImportedFiles(files, version)
    texts: dict[str, str] = {}
    try:
        for name, file in imported.reach(parse(source, version)):
            if file is not None:
                texts[name] = file.program.source.text
    except ScenarioError:
        # it has no results; whoever compiles it says why
        pass
    return "\n".join([source.text, *(f"{name}: {text}" for name, text in sorted(texts.items()))])

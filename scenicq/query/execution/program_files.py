"""Programs read from files, and the files that they import."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from scenicq.compiler.imported_files import ImportedFiles
from scenicq.errors import DataError, Diagnostic, ScenarioError, Source
from scenicq.syntax.parser import parse

__all__ = ["program_text", "read_program", "sibling_loader"]


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


def sibling_loader(path: Path) -> Callable[[str], Source | None]:
    """What reads the files that a program imports: those in its own folder, nothing else.

    Args:
        path: Of the program.
    """
    folder = path.resolve().parent

    def load(name: str) -> Source | None:
        file = (folder / name).resolve()
        if not file.is_relative_to(folder):
            return None
        if name.endswith("/"):
            return Source(str(file), "") if file.is_dir() else None
        return read_program(file) if file.is_file() else None

    return load


def program_text(source: Source, path: Path, version: int | None) -> str:
    """The text of a program and of all files that it imports: where one of them differs, the program is another.

    Args:
        source: The program.
        path: Its file.
        version: The version of Scenic, if it is known.
    """
    files = ImportedFiles(sibling_loader(path), version)
    texts: dict[str, str] = {}
    try:
        for name, file in files.reach(parse(source, version)):
            if file is not None:
                texts[name] = file.program.source.text
    except ScenarioError:
        # it has no results; whoever compiles it says why
        pass
    return "\n".join([source.text, *(f"{name}: {text}" for name, text in sorted(texts.items()))])

"""The wheel and the source archive: what is in them, and that the wheel that is installed is made of the archive."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

ROOT = Path(__file__).parents[3]
SOURCES = ("pyproject.toml", "README.md", "LICENSE", "scenicq", "cli")


def build_archives(scratch: Path) -> tuple[Path, Path]:
    """Build the source archive from a copy, and the wheel from that archive alone.

    Args:
        scratch: An empty folder.

    Returns:
        The archive and the wheel.
    """
    copy = scratch / "sources"
    copy.mkdir(parents=True)
    for name in SOURCES:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copyfile(source, copy / name)
    command = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(scratch / "dist"), str(copy)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"{done.stdout}{done.stderr}")
    (archive,) = (scratch / "dist").glob("*.tar.gz")
    (wheel,) = (scratch / "dist").glob("*.whl")
    return archive, wheel


def shipped() -> set[str]:
    """What the wheel must have, and nothing else: code, and the data that `pyproject.toml` names."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    found: set[str] = set()
    for package in settings["packages"]:
        inside = package.replace(".", "/")
        folder = ROOT / "cli" if package == "scenicq_cli" else ROOT / inside
        for pattern in ("*.py", *settings["package-data"].get(package, ())):
            found |= {f"{inside}/{path.name}" for path in folder.glob(pattern) if path.is_file()}
    return found


def files_of_wheel(wheel: Path) -> set[str]:
    """What a wheel installs, but for what it says of itself."""
    with zipfile.ZipFile(wheel) as opened:
        return {name for name in opened.namelist() if ".dist-info/" not in name}


def files_of_archive(archive: Path) -> set[str]:
    """What a source archive has, below its folder."""
    with tarfile.open(archive) as opened:
        return {name.partition("/")[2] for name in opened.getnames() if "/" in name}

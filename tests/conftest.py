"""What all tests share: golden files, the sample data, and the command line run in this process."""

import contextlib
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from hypothesis import HealthCheck, settings

from scenicq.importers.ingest import ingest
from scenicq_cli.main import cli
from scenicq_cli.sources import remember

ROOT = Path(__file__).parents[1]
SAMPLES = ROOT / "sample_data"
_HANGS_S = 1800

# The tests say the same each time, on a machine however busy; `make test-all` draws examples anew.
settings.register_profile("same", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("anew", deadline=None, print_blob=True, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("same")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--update-golden", action="store_true", help="write golden files instead of comparing with them")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Share out the cases of `one_in`. What is slow is slower still on a busy machine: only what hangs is stopped."""
    cases: Counter[str] = Counter()
    for item in items:
        _fewer_examples(item)
        sampled = item.get_closest_marker("one_in")
        if sampled is not None:
            name = item.nodeid.partition("[")[0]
            if cases[name] % sampled.args[0]:
                item.add_marker(pytest.mark.slow)
            cases[name] += 1
        if item.get_closest_marker("slow") and not item.get_closest_marker("timeout"):
            item.add_marker(pytest.mark.timeout(_HANGS_S))


_FEWER = 24
"""How many times fewer rounds a sweep makes where slow tests are left out."""


def _leaves_out_slow(config: pytest.Config) -> bool:
    return "not slow" in config.getoption("markexpr")


def _fewer_examples(item: pytest.Item) -> None:
    """Hypothesis draws all examples that a test asks for in `make test-all`."""
    test = getattr(getattr(item, "obj", None), "__func__", getattr(item, "obj", None))
    asked = getattr(test, "_hypothesis_internal_use_settings", None)
    if asked is not None and _leaves_out_slow(item.config) and not hasattr(test, "fewer_examples"):
        test.fewer_examples = True
        test._hypothesis_internal_use_settings = settings(asked, max_examples=-(-asked.max_examples // _FEWER))


@pytest.fixture(scope="session")
def rounds(request: pytest.FixtureRequest) -> Callable[[int], int]:
    """How many of so many rounds a sweep makes: all in `make test-all`."""
    fewer = _FEWER if _leaves_out_slow(request.config) else 1
    return lambda number: -(-number // fewer)


@pytest.fixture(scope="session", autouse=True)
def home_of_its_own(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """What the command line remembers between runs is not the user's."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state")))
        yield


@pytest.fixture
def started_processes() -> Callable[[], dict[int, bytes]]:
    """The processes that this one has started, each with its command, as far as /proc tells (Linux)."""

    def found() -> dict[int, bytes]:
        commands: dict[int, bytes] = {}
        for thread in Path("/proc/self/task").iterdir():
            # threads and processes end meanwhile
            with contextlib.suppress(OSError):
                for pid in (thread / "children").read_text().split():
                    with contextlib.suppress(OSError):
                        commands[int(pid)] = Path(f"/proc/{pid}/cmdline").read_bytes()
        return commands

    return found


@pytest.fixture
def golden(request: pytest.FixtureRequest) -> Callable[[str], None]:
    """Compare a text with tests/golden/<module>/<test>.txt; `make golden` rewrites the files."""
    here = Path(__file__).parent
    file = here / "golden" / request.path.relative_to(here).with_suffix("") / f"{request.node.name}.txt"

    def check(actual: str) -> None:
        if request.config.getoption("--update-golden"):
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(actual, encoding="utf-8")
        expected = file.read_text(encoding="utf-8") if file.exists() else ""
        assert actual == expected, f"differs from {file.relative_to(here)}: `make golden` rewrites it"

    return check


@pytest.fixture(scope="session")
def scenarios() -> Path:
    """The folder of the sample scenarios."""
    return SAMPLES / "scenarios"


@pytest.fixture(scope="session")
def crossroads(tmp_path_factory: pytest.TempPathFactory, home_of_its_own: None) -> Path:
    """The dataset that the command line makes from the sample recordings; only to be read."""
    target = tmp_path_factory.mktemp("datasets") / "crossroads"
    ingest(SAMPLES / "crossroads", target)
    remember(target, SAMPLES / "crossroads")
    return target


@pytest.fixture
def run() -> Callable[..., Result]:
    """Run `scenicq` with arguments in this process."""

    def invoke(*args: object, env: dict[str, str] | None = None) -> Result:
        return CliRunner().invoke(cli, [str(arg) for arg in args], prog_name="scenicq", env=env)

    return invoke


@pytest.fixture(scope="session")
def installed() -> Callable[..., "subprocess.CompletedProcess[str]"]:
    """Run the installed command `scenicq` as a process, in a folder."""
    command = command_path()

    def execute(*args: object, cwd: Path, **more: object) -> "subprocess.CompletedProcess[str]":
        words: Sequence[str] = [command, *(str(arg) for arg in args)]
        return subprocess.run(words, cwd=cwd, capture_output=True, text=True, timeout=120, check=False, **more)

    return execute


def command_path() -> str:
    """The installed command beside this interpreter."""
    found = Path(sys.executable).with_name("scenicq")
    assert found.exists(), "scenicq is not installed: `make setup`"
    return str(found)


@pytest.fixture(scope="session")
def command() -> str:
    """Path of the installed command."""
    return command_path()

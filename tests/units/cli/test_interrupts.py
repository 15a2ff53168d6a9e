"""An interrupt that gets lost on its way ends the command all the same."""

import os
import random
import signal
import subprocess
import sys
import time

import pytest

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")

PROGRAM = """
import os, signal, sys, time
import click
from scenicq_cli import interrupts, main

interrupts.INSIST_S = 0.2
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_DFL)

@click.command()
def info():
    try:
        os.kill(os.getpid(), signal.{name})
        time.sleep(5)
    except KeyboardInterrupt:
        {then}
    print("went on")

main.Commands.get_command = lambda *_: info
sys.argv = ["scenicq", "info"]
main.main()
"""


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
@pytest.mark.parametrize(
    "then",
    ["time.sleep(30)", "raise RuntimeError('Query interrupted')", "raise"],
    ids=["dropped", "another error", "as it should be"],
)
def test_an_interrupt_arrives(name, then):
    program = PROGRAM.format(name=name, then=then)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=20, check=False)
    assert "went on" not in done.stdout
    assert (done.returncode, done.stderr) == (130, "interrupted\n")


LOST = """
import os, signal, sys, time
import click
from scenicq_cli import main

signal.signal(signal.SIGINT, signal.default_int_handler)

@click.command()
def info():
    try:
        try:
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(5)
        except KeyboardInterrupt:
            {during}
    except RuntimeError:
        pass
    {after}
    print("went on")

main.Commands.get_command = lambda *_: info
sys.argv = ["scenicq", "info"]
main.main()
"""


@pytest.mark.parametrize("during", ["pass", "raise RuntimeError"])
def test_an_interrupt_that_a_library_swallows_is_raised_again_soon(during):
    program = LOST.format(during=during, after="time.sleep(30)")
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=15, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "interrupted\n")


def test_cleaning_up_is_left_its_time():
    program = LOST.format(during='time.sleep(1.5); os.write(1, b"cleaned"); raise', after="pass")
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=15, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (130, "cleaned", "interrupted\n")


DROPPED = """
import os, signal, sys, time, weakref
import click
from scenicq_cli import main

signal.signal(signal.SIGINT, signal.default_int_handler)

class Thing: {method}

@click.command()
def info():
    thing = Thing()
    watched = weakref.ref(thing, lambda _: {callback})
    for _ in range(3):
        del thing
        thing, watched = Thing(), None
    time.sleep(5)
    print("went on")

main.Commands.get_command = lambda *_: info
sys.argv = ["scenicq", "info"]
main.main()
"""
KILL = "os.kill(os.getpid(), signal.{name})"


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
@pytest.mark.parametrize("where", ["callback", "method"])
def test_an_interrupt_that_python_drops_arrives_at_once(name, where):
    kill = KILL.format(name=name)
    parts = {"callback": kill, "method": "pass"} if where == "callback" else {"callback": None, "method": ""}
    program = DROPPED.format(**parts | ({} if where == "callback" else {"method": f"__del__ = lambda _: {kill}"}))
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=4, check=False)
    assert "went on" not in done.stdout
    assert (done.returncode, done.stderr) == (130, "interrupted\n")


WORKERS = """
import os, signal, sys, time
os.write(1, b"importing\\n")
time.sleep(0.5)
import click
from scenicq.processes import Workers
from scenicq_cli import main

def start():
    return lambda task, tell: task

@click.command()
def info():
    with Workers(2, start) as workers:
        for _ in workers.run(range(1000000)):
            pass
    print("went on")

if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)
    main.Commands.get_command = lambda *_: info
    sys.argv = ["scenicq", "info"]
    main.main()
"""


def test_processes_that_are_only_starting_say_nothing_when_interrupted(tmp_path):
    (tmp_path / "program.py").write_text(WORKERS)
    command = [sys.executable, "-u", str(tmp_path / "program.py")]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    assert process.stdout is not None
    for _ in range(3):  # this process and both workers have begun, and these import for half a second
        assert process.stdout.readline() == "importing\n"
    os.killpg(process.pid, signal.SIGINT)
    told = process.communicate(timeout=20)
    assert (process.returncode, *told) == (130, "", "interrupted\n")


LOADING = """
import sys, time
import click
from scenicq_cli import main

@click.command()
def info():
    try:
        import native
    except Exception:
        import native  # an extension module may end the process here
    finally:
        sys.stdout.write(f"{getattr(sys.modules.get('native'), 'whole', None)}\\n")  # once: an interrupt may follow
    time.sleep(5)
    print("went on")

main.Commands.get_command = lambda *_: info
sys.argv = ["scenicq", "info"]
main.main()
"""
NATIVE = """
import os, signal, time
print("loads")
try:
    os.kill(os.getpid(), signal.{name})
    time.sleep(0.1)
except KeyboardInterrupt:
    raise ImportError("as an extension module says it")
whole = True
"""


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_a_module_is_loaded_once_and_whole_before_an_interrupt_arrives(tmp_path, name):
    (tmp_path / "native.py").write_text(NATIVE.format(name=name))
    (tmp_path / "program.py").write_text(LOADING)
    command = [sys.executable, str(tmp_path / "program.py")]
    heed = {"preexec_fn": lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)}
    done = subprocess.run(command, capture_output=True, text=True, timeout=20, check=False, **heed)
    assert done.stdout == "loads\nTrue\n"
    assert (done.returncode, done.stderr) == (130, "interrupted\n")


def test_a_module_that_does_not_end_loading_is_interrupted_all_the_same(tmp_path):
    (tmp_path / "native.py").write_text("import os, signal, time\nos.kill(os.getpid(), signal.SIGTERM)\ntime.sleep(30)")
    program = LOADING.replace("from scenicq_cli import main", "from scenicq_cli import interrupts, main\n")
    (tmp_path / "program.py").write_text(program.replace("@click", "interrupts.INSIST_S = 0.2\n\n@click", 1))
    done = subprocess.run(
        [sys.executable, str(tmp_path / "program.py")], capture_output=True, text=True, timeout=20, check=False
    )
    assert (done.returncode, done.stderr) == (130, "interrupted\n")


@pytest.mark.parametrize("name", ["SIGINT", "SIGHUP"])
def test_an_ignored_interrupt_stays_ignored(name):
    """As a job in the background has the one ignored, and `nohup` the other."""
    program = (
        "import os, signal\nfrom scenicq_cli.interrupts import Interrupts\n"
        f"signal.signal(signal.{name}, signal.SIG_IGN)\nInterrupts().heed()\n"
        f"os.kill(os.getpid(), signal.{name})\nprint('alive')"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=20, check=True)
    assert done.stdout == "alive\n"


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_run_in_one_process_goes_on_where_it_was_interrupted(command, crossroads, scenarios, tmp_path, number):
    given = [command, "match", str(scenarios / "04_two_lane_traffic.scenic"), str(crossroads), "--all", "--exit-zero"]
    given += ["--jobs", "1", "--no-prefilter", "--method", "smt", "--solver", "portable", "-o"]
    started = time.monotonic()
    subprocess.run([*given, str(tmp_path / "whole.jsonl")], check=True)
    takes_s = time.monotonic() - started
    (tmp_path / "new").mkdir()
    file, done = tmp_path / "new" / "found.jsonl", []
    parts = file.with_name(".found.jsonl.pieces")
    for _ in range(8):
        words = [*given, str(file), "--resume"]
        heed = {"preexec_fn": lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)}
        with subprocess.Popen(words, stderr=subprocess.PIPE, text=True, **heed) as process:
            if not done:
                # whatever the machine does besides, the first one comes while frames are matched
                while not parts.exists() and process.poll() is None:
                    time.sleep(0.01)
                time.sleep(random.uniform(0, 0.3))
            else:
                # later than the interpreter needs to start: before, nobody is there to heed
                time.sleep(random.uniform(0.2, 1.0) * takes_s)
            process.send_signal(number)
            _, told = process.communicate(timeout=120)
        # the last: nothing heeds any more while the interpreter ends, after all is done
        # before the command has read its options it cannot say how to go on
        told = told.removesuffix("  = hint: the same command goes on from here\n")
        assert (process.returncode, told) in ((130, "interrupted\n"), (0, ""), (-number, ""))
        assert file.exists() == (process.returncode != 130)
        done.append(process.returncode)
        if file.exists():
            break
    assert 130 in done
    subprocess.run([*given, str(file), "--resume"], check=True)
    assert file.read_bytes() == (tmp_path / "whole.jsonl").read_bytes()
    assert os.listdir(file.parent) == [file.name]

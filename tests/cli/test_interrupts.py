"""An interrupt that gets lost on its way ends the command all the same."""

import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")

PROGRAM = """
import os, signal, sys, time
import click
from scenicq_cli import interrupts, main

interrupts.INSIST_S = 0.2
signal.signal(signal.SIGINT, signal.default_int_handler)

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


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
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


def test_an_ignored_interrupt_stays_ignored():
    program = (
        "import os, signal\nfrom scenicq_cli.interrupts import Interrupts\n"
        "signal.signal(signal.SIGINT, signal.SIG_IGN)\nInterrupts().heed()\n"
        "os.kill(os.getpid(), signal.SIGINT)\nprint('alive')"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=20, check=True)
    assert done.stdout == "alive\n"

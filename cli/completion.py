"""`scenicq completion`: what makes a shell complete commands and options."""

from __future__ import annotations

import click
from click.shell_completion import get_completion_class

from .main import cli
from .manual import Manual
from .streams import say

__all__ = ["completion"]

_SHELLS = ("bash", "zsh", "fish")


@click.command(
    cls=Manual,
    arguments={"SHELL": "bash, zsh or fish."},
    epilog="\b\nExamples:\n"
    "  scenicq completion bash > ~/.local/share/bash-completion/completions/scenicq\n"
    "  scenicq completion zsh > ~/.zfunc/_scenicq\n"
    "  scenicq completion fish > ~/.config/fish/completions/scenicq.fish",
)
@click.argument("shell", metavar="SHELL", type=click.Choice(_SHELLS))
def completion(shell: str) -> None:
    """Print what makes a shell complete commands and options.

    Put it where the shell looks for completions; a new shell then knows them.
    """
    found = get_completion_class(shell)
    assert found is not None
    say(found(cli, {}, "scenicq", "_SCENICQ_COMPLETE").source())

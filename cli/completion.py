"""`scenicq completion`: what makes a shell complete commands and options."""

from __future__ import annotations

import click
from click.shell_completion import get_completion_class

from .main import cli

__all__ = ["completion"]

_SHELLS = ("bash", "zsh", "fish")


@click.command(
    epilog="\b\nExamples:\n"
    "  scenicq completion bash > ~/.local/share/bash-completion/completions/scenicq\n"
    "  scenicq completion zsh > ~/.zfunc/_scenicq\n"
    "  scenicq completion fish > ~/.config/fish/completions/scenicq.fish"
)
@click.argument("shell", type=click.Choice(_SHELLS))
def completion(shell: str) -> None:
    """Print what makes a shell complete commands and options."""
    found = get_completion_class(shell)
    assert found is not None
    click.echo(found(cli, {}, "scenicq", "_SCENICQ_COMPLETE").source())

"""The pages of this folder: commands with their output, word for word, over the sample data.

A block `scenic NAME` is written into the file of that name. The folder has `town`, the dataset of
`sample_data/crossroads`, and the sample scenarios. What goes to standard error comes before what goes to standard
output. A line `exit code N` says how a command ends that does not end with 0. `make golden` writes what is printed into
the pages.
"""

import re
import shlex
import shutil
from pathlib import Path

import pytest
from console_blocks import blocks, matches, steps

HERE = Path(__file__).parent
PAGES = sorted(HERE.glob("*.md"))
SLOW = {"advice.md"}


@pytest.mark.parametrize(
    "page", [pytest.param(each, marks=pytest.mark.slow if each.name in SLOW else ()) for each in PAGES],
    ids=lambda page: page.stem,
)  # fmt: skip
def test_commands_print_what_the_page_shows(page, run, crossroads, scenarios, tmp_path, monkeypatch, request):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "town").symlink_to(crossroads)
    for each in scenarios.glob("*.scenic"):
        shutil.copy(each, tmp_path)
    text = page.read_text(encoding="utf-8")
    asked = 0
    for block in blocks(text, "scenic", "console"):
        if block[1] == "scenic":
            (tmp_path / block[2]).write_text(block[3], encoding="utf-8")
            continue
        shown = ""
        for command, expected in steps(block[3]):
            done = run(*shlex.split(command)[1:])
            printed = re.sub(r"in [\d.]+ s$", "in ... s", f"{done.stderr}{done.stdout}", flags=re.MULTILINE)
            printed += f"exit code {done.exit_code}\n" if done.exit_code else ""
            shown += f"$ {command}\n" + re.sub(r"[ \t]+$", "", printed, flags=re.MULTILINE)
            asked += 1
            if not request.config.getoption("--update-golden"):
                assert matches(expected, printed), f"{page.name}: `make golden` writes this\n$ {command}\n{printed}"
        if request.config.getoption("--update-golden"):
            text = text.replace(block[0], f"```console\n{shown}```")
            page.write_text(text, encoding="utf-8")
    assert asked


def test_each_command_is_one_of_the_tool():
    for page in PAGES:
        for block in blocks(page.read_text(encoding="utf-8"), "console"):
            assert all(command.startswith("scenicq ") for command, _ in steps(block[3]))

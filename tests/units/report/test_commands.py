"""`scenicq show`, `scenicq match --report`, `scenicq report` and `scenicq completion`."""

import os
import pty
import re
import select
import shutil
import subprocess
import time
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from scenicq.report import png as png_module

FRAME = "03-busy-intersection/11"


@pytest.fixture
def crossing(scenarios):
    return scenarios / "02_crossing_cars.scenic"


def test_show_draws_a_frame(run, crossroads, crossing, tmp_path):
    plain = run("show", crossroads, FRAME)
    assert plain.exit_code == 0
    assert "leftward" not in plain.stdout
    assert ET.fromstring(plain.stdout).get("width") == "900"
    for name in ("a.svg", "a.html"):
        done = run(
            "show", crossroads, FRAME, "--scenario", crossing, "-o", tmp_path / name, "--half", "30", "--width", "300"
        )
        assert (done.exit_code, done.output) == (0, "")
        text = (tmp_path / name).read_text(encoding="utf-8")
        assert {"leftward", "car-left-1"} <= set(re.findall(r"[\w-]+", text))
    assert ET.parse(tmp_path / "a.svg").getroot().get("width") == "300"
    assert 'id="line-16"' in text


def test_show_says_why_a_frame_does_not_match(run, crossroads, scenarios, tmp_path):
    page = tmp_path / "cut.html"
    done = run("show", crossroads, FRAME, "--scenario", scenarios / "03_against_traffic.scenic")
    assert "excluded: ego.heading" in done.stdout
    assert "deg off" in done.stdout
    cut = run("show", crossroads, "06-cut-in/10", "--scenario", scenarios / "05_cut_in_from_right.scenic", "-o", page)
    assert (cut.exit_code, cut.output) == (0, "")
    text = page.read_text(encoding="utf-8")
    assert "allowed: -120.0 deg to -105.0 deg or -75.0 deg to -60.0 deg; 15.0 deg off" in text
    assert '<tr id="line-14" class="guilty">' in text
    assert text.count('class="guilty"') == 1
    wide = run(
        "show", crossroads, FRAME, "--scenario", scenarios / "02_crossing_cars.scenic", "--tolerance", "heading=5deg"
    )
    assert ">match</text>" in wide.stdout


@pytest.mark.parametrize(
    ("args", "told"),
    [
        (("nope",), "the dataset has no frame `nope`"),
        ((FRAME, "-o", "a.gif"), "does not say which format"),
        ((FRAME, "--scenario", "none.scenic"), "none.scenic cannot be read"),
        ((FRAME, "-o", "no/such/folder.svg"), "cannot be written"),
    ],
)
def test_show_says_what_is_wrong(run, crossroads, args, told):
    done = run("show", crossroads, *args)
    assert done.exit_code == 2
    assert told in done.stderr
    assert done.stdout == ""


def test_png_without_its_package_is_told_before_anything_is_done(run, crossroads, tmp_path, monkeypatch):
    monkeypatch.setattr(png_module, "find_spec", lambda _: None)
    monkeypatch.setattr("scenicq_cli.show.can_make_png", png_module.can_make_png)
    done = run("show", tmp_path / "no dataset", FRAME, "-o", tmp_path / "a.png")
    assert done.exit_code == 2
    assert "scenicq[png]" in done.stderr


@pytest.mark.skipif(not png_module.can_make_png(), reason="the extra scenicq[png] is not installed")
def test_show_writes_png(run, crossroads, tmp_path):
    assert run("show", crossroads, FRAME, "-o", tmp_path / "a.PNG", "--width", "100").exit_code == 0
    assert (tmp_path / "a.PNG").read_bytes().startswith(b"\x89PNG")


def test_match_writes_a_report_beside_its_results(run, crossroads, crossing, tmp_path):
    plain = run("match", crossing, crossroads)
    done = run("match", crossing, crossroads, "--report", tmp_path / "r", "--near", "1", "--all")
    assert done.exit_code == 0
    text = (tmp_path / "r" / "index.html").read_text(encoding="utf-8")
    frames = [line.split('"')[3] for line in plain.stdout.splitlines()]
    assert frames
    assert all(f"<b>{frame}</b>" in text for frame in frames)
    assert text.count("<article") == 2
    # on the contact sheet, and at its run
    assert text.count('badge near">near miss') == 2


def test_match_refuses_a_folder_of_others_before_it_starts(run, crossroads, crossing, tmp_path):
    (tmp_path / "mine.txt").touch()
    done = run("match", crossing, crossroads, "--report", tmp_path)
    assert (done.exit_code, done.stdout) == (2, "")
    assert "target-exists" in done.stderr


def test_report_compares_two_results(run, crossroads, crossing, tmp_path):
    before, after = tmp_path / "a.jsonl", tmp_path / "b.jsonl"
    run("match", crossing, crossroads, "-o", before)
    run("match", crossing, crossroads, "-o", after, "--classes", "coarse", "--all")
    done = run("report", before, after)
    assert done.exit_code == 0
    assert done.stdout.startswith("+      5  came")
    assert "+ 03-busy-intersection/16" in done.stdout
    assert "03-busy-intersection/11" not in done.stdout
    assert "03-busy-intersection/11" in run("report", before, after, "--all").stdout
    assert run("report", before, after, "-o", tmp_path / "c.html").stdout == ""
    assert "03-busy-intersection/16" in (tmp_path / "c.html").read_text(encoding="utf-8")
    assert run("report", before, tmp_path / "none").exit_code == 2


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion(run, shell, tmp_path):
    done = run("completion", shell)
    assert done.exit_code == 0
    assert "_SCENICQ_COMPLETE" in done.stdout
    if shutil.which(shell):
        script = tmp_path / "script"
        script.write_text(done.stdout)
        assert subprocess.run([shell, "-n", str(script)], check=False).returncode == 0


def _typed(words, lines, wanted):
    """What a terminal with a shell shows after lines were typed, until it shows what is wanted."""
    terminal, inner = pty.openpty()
    shown = ""
    with subprocess.Popen(words, stdin=inner, stdout=inner, stderr=inner, start_new_session=True) as process:
        os.close(inner)
        try:
            deadline = time.monotonic() + 20
            os.write(terminal, lines.encode())
            while wanted not in shown and time.monotonic() < deadline:
                if select.select([terminal], [], [], 0.2)[0]:
                    shown += os.read(terminal, 4096).decode(errors="replace")
                    shown = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]|\x1b[=>]|\x07|[^\n]\x08", "", shown)
        finally:
            process.kill()
            os.close(terminal)
    return shown


@pytest.mark.parametrize("shell", ["bash", "zsh"])
def test_a_shell_completes(run, shell, command, tmp_path):
    if not shutil.which(shell):
        pytest.skip(f"there is no {shell}")
    script = tmp_path / "_scenicq"
    script.write_text(run("completion", shell).stdout)
    start = {
        "bash": ["bash", "--norc", "--noprofile", "-i"],
        "zsh": ["zsh", "-f", "-i"],
    }
    ready = f"autoload -U compinit; compinit -u -d {tmp_path}/dump; " if shell == "zsh" else ""
    path = f"PATH={Path(command).parent}:$PATH; "
    shown = _typed(start[shell], f"{path}{ready}source {script}\nscenicq comple\t", "scenicq completion")
    assert "scenicq completion" in shown


def test_fish_completes(run, command, tmp_path):
    if not shutil.which("fish"):
        pytest.skip("there is no fish")
    script = tmp_path / "scenicq.fish"
    script.write_text(run("completion", "fish").stdout)
    program = f'set PATH {Path(command).parent} $PATH; source {script}; complete -C "scenicq comple"'
    done = subprocess.run(
        ["fish", "--no-config", "-c", program],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "HOME": str(tmp_path)},
    )
    assert done.stdout.startswith("completion")


def test_completion_completes(run):
    env = {"_SCENICQ_COMPLETE": "bash_complete", "COMP_WORDS": "scenicq sho", "COMP_CWORD": "1"}
    assert run(env=env).stdout.split(",")[-1].strip() == "show"
    env |= {"COMP_WORDS": "scenicq show --sce", "COMP_CWORD": "2"}
    assert "plain,--scenario" in run(env=env).stdout

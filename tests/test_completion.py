"""Commands and options are completed in the shells that say so, and other shells are refused."""

import re
import shutil
import subprocess

import pytest

from hexmj.cli.commands import COMMANDS


@pytest.mark.slow
def test_bash_completes_commands_and_options_and_nothing_else(run, tmp_path):
    code, script, _ = run("--completion", "bash")
    assert code == 0
    (tmp_path / "hexmj.bash").write_text(script)
    for words, known in (
        ("ren", {"render"}),
        ("flss --st", {"--starts", "--step-height", "--standing-height"}),
        ("flss --observation time ", {"walk", "start"}),
        ("walk --order un", {"undelayed"}),
        ("view --host ", set()),
        ("flss --out hexmj.", {"hexmj.bash"}),
    ):
        typed = ["hexmj", *re.sub(" $", " ''", words).split()]
        ask = f"source hexmj.bash; COMP_WORDS=({' '.join(typed)}); COMP_CWORD={len(typed) - 1}; _tyro_hexmj"
        told = subprocess.run(
            ["bash", "-c", ask + '; echo "${COMPREPLY[@]}"'], cwd=tmp_path, capture_output=True, text=True, check=True
        )
        assert set(told.stdout.split()) == known


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_every_shell_is_told_what_each_command_does(run, shell):
    _, script, _ = run("--completion", shell)
    assert "'view': {'description': 'Look at an insect while it walks, or at a recording: in MuJoCo" in script
    assert not [name for name in COMMANDS if f"'{name}': {{'description': '{name}'" in script]


@pytest.mark.thorough
def test_fish_completes_by_a_pipe_since_no_argument_may_be_so_long(run, tmp_path):
    code, script, _ = run("--completion", "fish")
    assert code == 0
    assert re.findall(r".*\$python_cmd .*", script) == [
        '    set -l results (printf "%s\\n" "$pycode" | $python_cmd - $words $current)'
    ]
    if fish := shutil.which("fish"):
        (tmp_path / "hexmj.fish").write_text(script)
        ask = [fish, "--no-config", "-c", "source hexmj.fish; complete -C 'hexmj ren'"]
        told = subprocess.run(ask, cwd=tmp_path, capture_output=True, text=True, check=True)
        assert told.stdout.split()[0] == "render"


@pytest.mark.parametrize(
    "words", [["--completion"], ["--completion", "ksh"], ["flss", "--tyro-print-completion", "sh"]]
)
def test_other_shells_are_refused_in_a_sentence(run, words):
    code, out, error = run(*words)
    assert (code, out) == (2, "")
    assert error.startswith("hexmj: ") and error.endswith("expected one of bash, zsh, fish\n")
    assert words != ["--completion"] or error == "hexmj: --completion stands alone; expected one of bash, zsh, fish\n"

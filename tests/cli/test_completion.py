"""`completion`: a real bash completes commands, options, names and files."""

import shutil
import subprocess
import sys

import pytest

from adhesion_can.cli.main import COMMANDS, main
from adhesion_can.extras import install_extra


@pytest.fixture(scope="module")
def script(tmp_path_factory):
    path = tmp_path_factory.mktemp("completion") / "adhesion-can.bash"
    command = [sys.executable, "-m", "adhesion_can.cli.main", "completion", "bash"]
    path.write_bytes(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)
    return path


def completed(script, folder, *words):
    """Words that bash offers for the last one."""
    ask = (
        'source "$0"; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); '
        'read -r _ _ function _ <<<"$(complete -p adhesion-can | sed "s/.*-F //;s/^/x y /")"; '
        '$function adhesion-can "${@: -1}" ""; printf "%s\\n" "${COMPREPLY[@]}"'
    )
    done = subprocess.run(
        ["bash", "-c", ask, str(script), "adhesion-can", *words],
        cwd=folder,
        check=True,
        capture_output=True,
        text=True,
    )
    assert done.stderr == ""
    return set(done.stdout.split())


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash")
@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        (["re"], {"replay"}),
        ([""], set(COMMANDS)),
        (["replay", "--est"], {"--estimator"}),
        (["simulate", "--closed"], {"--closed-loop"}),
        (["simulate", "--scenario", "polach-w"], {"polach-wet"}),
        (["replay", "--estimator", "tr"], {"tracker"}),
        (["identify", "--curve", "pol"], {"polach"}),
        (["check", "--dbc", "mi"], {"mine.dbc"}),
        (["completion", "z"], {"zsh"}),
    ],
)
def test_bash_completes(script, tmp_path, words, wanted):
    (tmp_path / "mine.dbc").write_text("")
    assert completed(script, tmp_path, *words) == wanted


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_other_shells_have_every_command(shell, capsys):
    assert main(["completion", shell]) == 0
    text = capsys.readouterr().out
    assert all(name in text for name in COMMANDS)
    assert "closed-loop" in text


def test_without_the_extra_the_error_names_it(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "shtab", None)
    assert main(["completion", "bash"]) == 2
    assert install_extra("completion") in capsys.readouterr().err

"""Completion in a shell: commands, subcommands, flags and choices, as bash completes them."""

import subprocess

import pytest

from perception.cli.main import main


@pytest.fixture(scope="module")
def script(tmp_path_factory):
    folder = tmp_path_factory.mktemp("completion")
    written = folder / "trifuse.bash"
    with pytest.MonkeyPatch.context() as patch:
        lines = []
        patch.setattr("builtins.print", lambda text, **_: lines.append(text))
        assert main(["completion", "bash"]) == 0
    written.write_text("\n".join(lines))
    return written


def completed(script, *words):
    """Return what bash offers for the last of the words."""
    typed = " ".join(f"'{word}'" for word in words)
    code = (
        f"source {script}; COMP_WORDS=({typed}); COMP_CWORD={len(words) - 1}; "
        "_shtab_trifuse; echo ${COMPREPLY[@]}"
    )
    ran = subprocess.run(["bash", "-c", code], capture_output=True, text=True, check=True)
    return ran.stdout.split()


def test_commands_flags_and_choices_are_completed(script):
    assert completed(script, "trifuse", "ch") == ["check"]
    assert {"ground", "detection"} <= set(completed(script, "trifuse", "evaluate", ""))
    assert completed(script, "trifuse", "run", "--min-v") == ["--min-vehicle-score"]
    assert completed(script, "trifuse", "run", "--on-bad-frame", "") == ["stop", "skip"]
    assert completed(script, "trifuse", "train", "detector", "--modality", "d") == ["dm"]


def test_zsh_has_the_commands_too(capsys):
    assert main(["completion", "zsh"]) == 0
    printed = capsys.readouterr().out
    assert printed.startswith("#compdef trifuse")
    assert "read a drive; report what is missing" in printed


def test_another_shell_is_refused(capsys):
    assert main(["completion", "tcsh"]) == 2
    assert "bash" in capsys.readouterr().err

"""The console script: commands, groups, exit codes, and what is written to which stream."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from perception.cli.main import COMMANDS, SUMMARIES, main

# Lightning's groups are imported to be listed.
TRAININGS = ("train detector", "train bev", "train depthcn", "train fusion")
ROOT = Path(__file__).parents[2]


def test_every_command_is_listed_with_its_summary(capsys):
    assert main([]) == 0
    printed = capsys.readouterr().out
    for name in (name for name in SUMMARIES if " " not in name):
        assert f"\n  {name} " in printed


@pytest.mark.parametrize("group", ["evaluate", "study"])
def test_a_group_lists_its_commands(group, capsys):
    assert main([group, "--help"]) == 0
    printed = capsys.readouterr().out
    assert all(name in printed for name in COMMANDS if name.startswith(f"{group} "))


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_explains_every_flag(name):
    text = COMMANDS[name].help(name, everything=not name.startswith(TRAININGS))
    lines = text.splitlines()
    flags = [number for number, line in enumerate(lines) if line.startswith("  -")]
    bare = [
        lines[number]
        for number in flags
        if len(lines[number].split("  ")) < 3 and not lines[number + 1].startswith(" " * 20)
    ]
    assert bare == []
    assert any(line.startswith("Example: trifuse") for line in lines)


@pytest.mark.parametrize("words", [["fly"], ["evaluate", "fly"], ["run"], ["run", "nowhere"]])
def test_an_error_is_exit_code_2_and_one_line(words, capsys):
    assert main(words) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith(f"trifuse {words[0]}: ")
    assert captured.err.count("\n") == 1


def test_the_help_of_every_command_imports_no_heavy_library():
    code = (
        "import sys\n"
        "from perception.cli.main import COMMANDS\n"
        "heavy = {'torch', 'scipy', 'cv2', 'onnxruntime', 'numba', 'matplotlib', 'av'}\n"
        "found = {}\n"
        "for name, command in COMMANDS.items():\n"
        f"    command.help(name, everything=not name.startswith({TRAININGS}))\n"
        "    for module in heavy & {*sys.modules} - {*found}:\n"
        "        found[module] = name\n"
        "print(sorted(found.items()))"
    )
    ran = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert ran.stdout.splitlines()[-1] == "[]"


@pytest.mark.parametrize(
    ("words", "advice"),
    [
        (["check", "x"], "repeat the command"),
        (["synth", "x"], "repeat the command with --overwrite"),
        (["train", "depthcn", "x"], "go on with: trifuse train"),
    ],
)
def test_an_interrupt_is_130_and_says_how_to_go_on(words, advice, monkeypatch, capsys):
    def interrupted(*_):
        raise KeyboardInterrupt(*([advice] if words[0] == "train" else []))

    monkeypatch.setattr("perception.cli.main.call", interrupted)
    monkeypatch.setattr("perception.cli.train.train", interrupted)
    assert main(words) == 130
    error = capsys.readouterr().err
    assert (error.count("\n"), error.endswith(f"; {advice}\n")) == (1, True)


def test_a_termination_ends_as_an_interrupt_does():
    code = """import signal, sys; from perception.cli import main as program
program.run_command_line = lambda words: signal.raise_signal(signal.SIGTERM)
sys.exit(program.main())"""
    ran = subprocess.run(
        [sys.executable, "-c", code, "label"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    advice = "repeat the command with --resume to go on, or with --overwrite"
    sentence = f"trifuse label: stopped; what is complete is kept; {advice}\n"
    assert (ran.returncode, ran.stderr) == (130, sentence)


def test_of_libraries_only_warnings_are_shown():
    code = """import logging; from perception.cli.main import main
main(["--version"])
for name in ("matplotlib.font_manager", "perception.tracking"):
    logging.getLogger(name).info("%s: news", name)
logging.getLogger("matplotlib").warning("a warning")"""
    ran = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert ran.stderr.splitlines() == ["perception.tracking: news", "a warning"]


def test_output_that_cannot_be_written_is_one_sentence():
    with Path("/dev/full").open("w") as full:
        ran = subprocess.run(
            [sys.executable, "-c", "import sys; from perception.cli.main import main; sys.exit(main())", "study", "--help"],
            cwd=ROOT, stdout=full, stderr=subprocess.PIPE, text=True, check=False,
        )  # fmt: skip
    assert ran.returncode == 2
    assert ran.stderr.startswith("trifuse study: output: ")
    assert ran.stderr.count("\n") == 1


def test_help_is_quick():
    start_s = time.perf_counter()
    subprocess.run(
        [sys.executable, "-m", "perception", "run", "--help"],
        cwd=ROOT, capture_output=True, check=True,
    )  # fmt: skip
    # 0.4 s on an idle machine; the limit leaves room for tests beside this one.
    assert time.perf_counter() - start_s < 3


def test_processes_of_a_command_import_no_module_of_the_working_folder(tmp_path):
    for name in ("random", "types", "numpy"):
        (tmp_path / f"{name}.py").write_text("raise RuntimeError('a file of the user')\n")
    script = tmp_path / "bin" / "trifuse"
    script.parent.mkdir()
    script.write_text(
        "import multiprocessing\nfrom perception.cli.main import main\n"
        "if __name__ == '__main__':\n"
        "    main()\n"
        "    process = multiprocessing.get_context('spawn').Process(target=print, args=('ok',))\n"
        "    process.start(); process.join()"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), *sys.path])}
    ran = subprocess.run(
        [sys.executable, script, "--version"],
        cwd=tmp_path, env=environment, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert ran.stdout.splitlines()[-1] == "ok", ran.stderr

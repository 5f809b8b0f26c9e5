"""The wheel, built and installed into an environment of its own: the program runs from it, away from the source tree."""

import os
import subprocess
import sys
import sysconfig
import venv
from pathlib import Path
from zipfile import ZipFile

import pytest

from data.synthetic.collection import SynthConfig, write_drives
from perception import __version__
from perception.sensor import VLP_16

ROOT = Path(__file__).parents[1]


def run(*words: str | Path, folder: Path = ROOT) -> str:
    outside = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    ran = subprocess.run(
        words, cwd=folder, env=outside, capture_output=True, text=True, check=False
    )
    assert ran.returncode == 0, ran.stderr
    return ran.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("dist")
    run(sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", folder)
    (built,) = folder.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory) -> Path:
    """Return an environment with the wheel; its dependencies are those of the environment of the tests."""
    folder = tmp_path_factory.mktemp("environment")
    venv.create(folder, with_pip=False, symlinks=True)
    python = folder / "bin" / "python"
    run(
        sys.executable, "-m", "pip", "--python", python, "install", "--no-deps", "--no-index", wheel
    )
    (packages,) = (folder / "lib").glob("python*/site-packages")
    (packages / "dependencies.pth").write_text(f"{sysconfig.get_path('purelib')}\n")
    return folder


def test_the_wheel_has_the_program_its_networks_and_the_documents(wheel):
    names = ZipFile(wheel).namelist()
    assert "perception/detection/weights/fusion_default.onnx" in names
    assert any(name.endswith("share/doc/trifuse/docs/install.md") for name in names)
    packages = {name.partition("/")[0] for name in names if name.endswith("/__init__.py")}
    assert packages == {"perception", "data", "train", "export"}


def test_twine_accepts_the_wheel(wheel):
    assert "PASSED" in run(sys.executable, "-m", "twine", "check", "--strict", wheel)


def test_the_program_runs_from_the_wheel(installed, tmp_path):
    trifuse = installed / "bin" / "trifuse"
    assert run(trifuse, "--version", folder=tmp_path) == f"trifuse {__version__}\n"
    place = "import perception, data, train, export; print(*(m.__file__ for m in (perception, data, train, export)))"
    files = run(installed / "bin" / "python", "-P", "-c", place, folder=tmp_path).split()
    assert all(Path(file).is_relative_to(installed) for file in files)


def test_a_drive_is_checked_by_the_wheel(installed, tmp_path):
    (drive,) = write_drives(tmp_path, SynthConfig(frames=2, sensor=VLP_16, images=False))
    checked = run(installed / "bin" / "trifuse", "check", drive, folder=tmp_path)
    assert "VLP-16" in checked

"""Libraries write nothing about damaged files to the screen: a user reads our sentence alone."""

import subprocess
import sys
import warnings

import cv2
import numpy as np
import pytest

from tests.car_frames import write_car_frames
from tests.fuzz.parsers import PARSERS
from tests.fuzz.refusal import place, refusal

FILES_A_PARSER = 40
# Users do not see warnings of these kinds; those of Pillow are filtered where it is imported.
UNSEEN = (DeprecationWarning, ResourceWarning)


def damaged(data: bytes, random: np.random.Generator) -> bytes:
    """Cut a file off, or replace some of its bytes."""
    if random.random() < 0.3 or not data:
        return data[: random.integers(len(data) + 1)]
    changed = np.frombuffer(data, np.uint8).copy()
    places = random.integers(len(data), size=random.choice([1, 3, 20]))
    changed[places] = random.integers(256, size=len(places))
    return changed.tobytes()


@pytest.mark.parametrize("name", PARSERS)
def test_libraries_are_silent_about_damaged_files(name, tmp_path, capfd):
    parser, random = PARSERS[name], np.random.default_rng(0)
    path, seeds = place(parser, tmp_path), parser.seeds()
    capfd.readouterr()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("default")
        for number in range(FILES_A_PARSER):
            refusal(parser, path, damaged(seeds[number % len(seeds)], random))
    seen = [one for one in caught if not issubclass(one.category, UNSEEN)]
    assert [str(one.message) for one in seen if "PIL" not in one.filename] == []
    out, lines = capfd.readouterr()
    assert out == ""
    # Our own warning, by the log.
    assert all(line.startswith("replaced the damaged cache") for line in lines.splitlines())


def test_a_command_states_a_damaged_image_in_one_sentence(tmp_path):
    write_car_frames(tmp_path, frames=1)
    image = np.random.default_rng(0).integers(0, 255, (375, 1242)).astype(np.uint8)
    data = bytearray(cv2.imencode(".png", image)[1].tobytes())
    data[5000] ^= 255
    path = tmp_path / "training/image_2/000000.png"
    path.parent.mkdir()
    path.write_bytes(data)
    ran = subprocess.run(
        [sys.executable, "-m", "perception", "check", str(tmp_path)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert f"{path}: expected a whole PNG or JPEG image" in ran.stdout
    lines = [line for line in ran.stderr.splitlines() if line and "frame/s" not in line]
    assert lines == [
        f"trifuse check: {tmp_path}: expected a drive without faults, found 1; "
        "the table shows the first example of each kind"
    ]

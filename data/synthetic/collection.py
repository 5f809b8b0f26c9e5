"""Several synthetic drives, each of another world."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from data.synthetic import writer
from data.synthetic.drive import SyntheticDrive
from data.synthetic.folder_writer import write_folder
from data.synthetic.ins import InsNoise
from data.synthetic.words import SYNTH_LAYOUTS, CameraName, StreetKind, SynthLayout
from data.synthetic.world_config import WorldConfig
from data.synthetic.world_kinds import STREETS, draw_config
from perception.errors import UsageError
from perception.geometry.threads import limit_blas_threads
from perception.sensor import HDL_64E, LidarModel

_FRAMES_A_WORLD = 5  # of the object layout
_FRAMES_APART = 18  # so that the scenery is another


@dataclass(frozen=True)
class SynthConfig:
    """Configuration of synthetic drives.

    Attributes:
        layout: KITTI's raw, tracking or object layout, or a folder with its drive.yaml.
        frames: Number of frames of each drive; of all together in the object layout.
        drives: Number of drives; the object layout takes as many worlds as it needs.
        sensor: LiDAR model.
        seed: Seed of the first drive; the next drives have the next seeds.
        noise: Noise of the INS.
        images: Whether to write images.
        street: Kind of street of every drive; else the same.
        ego_m_s: Desired speed of the ego vehicle in m/s; else that of the street.
        is_night: Whether it is night.
        cameras: Cameras of the vehicle, the main one first; several in the folder layout alone.
        config: Street of every drive; else the first is the demonstration street and each next
            one another kind.
    """

    layout: SynthLayout = "raw"
    frames: int = 80
    drives: int = 1
    sensor: LidarModel = HDL_64E
    seed: int = 0
    noise: InsNoise = field(default_factory=InsNoise)
    images: bool = True
    street: StreetKind | None = None
    ego_m_s: float | None = None
    is_night: bool = False
    cameras: tuple[CameraName, ...] = ("front",)
    config: WorldConfig | None = None

    def __post_init__(self) -> None:
        """Validate the number of frames, the layout and the speed."""
        if self.frames < 1 or self.drives < 1:
            found = f"{self.drives} drives of {self.frames} frames"
            raise UsageError("synthetic drives", expected="at least one frame", found=found)
        if self.layout not in SYNTH_LAYOUTS:
            expected = "raw, tracking, object or folder"
            raise UsageError("layout", expected=expected, found=repr(self.layout))
        if self.layout != "folder" and len(self.cameras) > 1:
            raise UsageError(
                f"--cameras {','.join(self.cameras)}",
                expected=f"one camera, which is what the {self.layout} layout holds",
                found=str(len(self.cameras)),
                advice="write the drive with --layout folder",
            )
        if self.ego_m_s is not None:
            WorldConfig(ego_m_s=self.ego_m_s)

    @property
    def units(self) -> int:
        """Number of drives, or of worlds in the object layout: what can be written apart."""
        return self.drives if self.layout != "object" else -(-self.frames // _FRAMES_A_WORLD)

    def named_part(self, text: str | None) -> "SynthPart":
        """Return the part of a text such as 3/8, the third of eight; all without a text.

        Raises:
            UsageError: There is no such part.
        """
        number, _, count = (text or "1/1").partition("/")
        if not (number.isdecimal() and count.isdecimal()):
            raise UsageError("--part", expected="a part such as 3/8", found=str(text))
        return self.part(int(number), int(count))

    def part(self, number: int = 1, count: int = 1) -> "SynthPart":
        """Return one of some parts of about the same size.

        Args:
            number: Number of the part, from 1.
            count: Number of parts.

        Raises:
            UsageError: There is no such part.
        """
        if not 1 <= number <= count <= self.units:
            expected = f"one of at most {self.units} parts, such as 1/{self.units}"
            raise UsageError("--part", expected=expected, found=f"{number}/{count}")
        first, end = ((n * self.units) // count for n in (number - 1, number))
        if self.layout != "object":
            return SynthPart(range(first, end), self.frames * (end - first))
        frames = min(end * _FRAMES_A_WORLD, self.frames) - first * _FRAMES_A_WORLD
        return SynthPart(range(first, end), frames)


@dataclass(frozen=True)
class SynthPart:
    """Some of the drives, or of the worlds of the object layout.

    Attributes:
        numbers: Numbers of the drives or worlds.
        frames: Number of their frames.
    """

    numbers: range
    frames: int


def write_drives(
    out: Path,
    synth_config: SynthConfig,
    done: Callable[[], object] = lambda: None,
    part: SynthPart | None = None,
) -> list[Path]:
    """Write drives below a folder; return the folder that opens as each.

    Args:
        out: Folder for the drives.
        synth_config: Configuration of the drives.
        done: Function called after each frame.
        part: Drives or worlds to write; else all. The same files, whatever the parts.
    """
    part = part or synth_config.part()
    with limit_blas_threads():  # frames are written side by side already
        if synth_config.layout == "object":
            return [_write_object_frames(out, synth_config, part.numbers, done)]
        write = {
            "raw": writer.write_raw, "tracking": writer.write_tracking, "folder": write_folder,
        }[synth_config.layout]  # fmt: skip
        return [
            write(draw_drive(synth_config, number, synth_config.frames), out, number, done)
            for number in part.numbers
        ]


def draw_drive(synth_config: SynthConfig, number: int, frames: int) -> SyntheticDrive:
    """Draw one of the drives of a recipe."""
    seed = synth_config.seed + number
    config = synth_config.config
    if config is None:
        rng = np.random.default_rng([seed, 0xC0])
        is_demonstration = number == 0 and synth_config.layout != "object"
        if synth_config.street is not None:
            config = STREETS[synth_config.street](rng)
        else:
            config = WorldConfig() if is_demonstration else draw_config(rng)
    if synth_config.ego_m_s is not None:
        config = replace(config, ego_m_s=synth_config.ego_m_s)
    if synth_config.is_night:
        config = replace(config, is_night=True)
    return SyntheticDrive(
        frames, seed=seed, sensor=synth_config.sensor, config=config, noise=synth_config.noise,
        images=synth_config.images, cameras=synth_config.cameras,
    )  # fmt: skip


def _write_object_frames(
    out: Path, synth_config: SynthConfig, worlds: range, done: Callable[[], object]
) -> Path:
    folder = out
    for world in worlds:
        first = world * _FRAMES_A_WORLD
        count = min(_FRAMES_A_WORLD, synth_config.frames - first)
        frames = range(0, _FRAMES_APART * count, _FRAMES_APART)
        drive = draw_drive(synth_config, world, frames[-1] + 1)
        folder = writer.write_objects(drive, out, first, frames, done)
    return folder

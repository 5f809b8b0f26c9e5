"""Flags that several commands share, each declared once."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from data.results.command_config import SECTION, CommandConfig
from data.splits.parts import Part
from perception import __version__
from perception.cli.parser import FlagGroup
from perception.errors import UsageError
from perception.types import OnBadFrame

if TYPE_CHECKING:
    from data.detections.measured_drives import DriveReader
    from data.layouts import OpenConfig
    from data.results.evaluated import EvaluationDocument
    from data.results.folder import ResultsFolder
    from perception.evaluation.report import Report


@dataclass(frozen=True)
class SourceFlags(FlagGroup):
    """Drive.

    Attributes:
        sequence: Sequence of a tracking folder, such as 0000; all of them where a command takes several.
        sensor: LiDAR model, such as HDL-64E, VLP-16 or OS1-64, or a .yaml or .json file that describes one; by
            default that of the drive, or HDL-64E.
        camera: Camera of the drive or topic of a bag, several with commas, the main one first; by default the forward one.
        lidar: LiDAR of the drive, topic of a bag or address of packets, several with commas; by default the first or all of them.
        odometry: Topic of the poses of a bag or robot; by default the one with most messages.
        deskew: Move the points of a sweep to the time of the scan, where their times are known.
        reflectance_scale: Full scale of the reflectance, such as 255; estimated from some scans by default.
        columns: Columns of the scans of a folder in order, where the files do not name them: x,y,z,intensity,ring,t; _
            for others.
    """

    sequence: str | None = None
    sensor: str | None = None
    camera: str | None = None
    lidar: str | None = None
    odometry: str | None = None
    deskew: bool = False
    reflectance_scale: float | None = None
    columns: tuple[str, ...] = ()

    @property
    def reading(self) -> "OpenConfig":
        """How the drive is read.

        Raises:
            PerceptionError: The full scale of the reflectance is not above 0, columns are not those of a scan, or the start
                is negative or the step of the frames not positive.
        """
        from data.layouts import OpenConfig
        from perception.cli.progress import frame_progress_bar

        same = vars(OpenConfig()).keys() & vars(self).keys()
        values = {name: getattr(self, name) for name in same}
        return OpenConfig(**values, progress=frame_progress_bar("fitting boxes"))


@dataclass(frozen=True)
class DriveFlags(SourceFlags):
    """Frames of the drive.

    Attributes:
        frames: Number of frames from the start of the drive; all by default.
        every: Step from frame to frame: 5 takes every fifth, as of a LiDAR of a fifth of the rate.
        on_bad_frame: Stop at a damaged frame and keep the results so far, or skip the frame with a warning.
    """

    frames: int | None = None
    every: int = 1
    on_bad_frame: OnBadFrame = "stop"

    def __post_init__(self) -> None:
        """Validate the number of frames."""
        require_positive("--frames", self.frames)

    def reader(self) -> "DriveReader":
        """Return what opens and reads the drives, with a progress bar."""
        from data.detections.measured_drives import DriveReader
        from perception.cli.progress import progress_bar

        same = ("sequence", "frames", "on_bad_frame", "split", "part")
        values = {name: value for name, value in vars(self).items() if name in same}
        return DriveReader(**values, reading=self.reading, progress=progress_bar)


@dataclass(frozen=True)
class PartOfDriveFlags(DriveFlags):
    """Frames of the drive.

    Attributes:
        start: Number of frames to skip at the start of the drive; --frames counts from there.
    """

    start: int = 0


@dataclass(frozen=True)
class LabelledDriveFlags(DriveFlags):
    """Frames of the drive.

    Attributes:
        split: Split file of `trifuse split`, of which one part is evaluated; all frames by default.
        part: Part of the split: train, val or test; test by default.
    """

    split: Path | None = None
    part: Part | None = None

    def __post_init__(self) -> None:
        """Validate the number of frames, and that a part is one of a split."""
        super().__post_init__()
        require_split(self.part, self.split)


@dataclass(frozen=True)
class ResultsFlags(FlagGroup):
    """Results.

    Attributes:
        out: Folder for the results; by default results/<time>, to which results/latest points.
        overwrite: Replace the results of an earlier run of this command in that folder; other files stay.
    """

    out: Path | None = None
    overwrite: bool = False

    def folder(self, config: CommandConfig) -> "ResultsFolder":
        """Return the folder for the results of a command; it stays as it is until it is prepared.

        Raises:
            UsageError: It is a file, or holds results that are not to be replaced.
        """
        from data.results.folder import ResultsFolder

        return ResultsFolder.choose(self.out, config, overwrite=self.overwrite)


@dataclass(frozen=True)
class ReportFlags(FlagGroup):
    """Report.

    Attributes:
        json: JSON file for the metrics, with protocol, data and configuration.
        html: HTML file for the same with figures, which needs no network; by default beside the JSON file, under its name.
        report: Write the HTML file beside the JSON file, where plotly is installed.
    """

    json: Path | None = None
    html: Path | None = None
    report: bool = True

    def __post_init__(self) -> None:
        """Validate that an HTML file can be written, before the work.

        Raises:
            MissingDependencyError: Plotly is not installed.
        """
        if self.html is not None:
            from data.report.page import require_plotly

            require_plotly()

    @property
    def has_files(self) -> bool:
        """Whether a file is asked for."""
        return self.json is not None or self.html is not None

    def publish(
        self, heading: str, report: "Report", document: "EvaluationDocument", config: CommandConfig
    ) -> None:
        """Print the tables of a report below a heading; write its metrics into the files that are asked for.

        `--config` reads the configuration of the JSON file back.
        """
        tables = report.tables()
        print("\n\n".join([heading, *(table.text() for table in tables)]))
        if self.has_files:
            stated = {**vars(document), SECTION: config.values, "program": f"trifuse {__version__}"}
            printed = [table.printed() for table in tables]
            self.write({**stated, "tables": printed, "results": report.to_json()})

    def write(self, document: object) -> None:
        """Write a document into the files that are asked for; raise WriteError where one cannot be written."""
        from data.report.report_file import write_documents

        page = write_documents(document, self.json, self.html, has_page=self.report)
        if page is not None:
            print(f"report: {page}")


def require_positive(flag: str, count: int | None) -> None:
    """Validate a count: at least one, or None for no limit.

    Raises:
        UsageError: it is below one.
    """
    if count is not None and count < 1:
        raise UsageError(flag, expected="at least 1", found=str(count))


def require_split(part: Part | None, split: Path | None) -> None:
    """Validate that a part is named with a split alone.

    Raises:
        UsageError: there is no split.
    """
    if part is not None and split is None:
        raise UsageError(f"--part {part}", expected="--split FILE beside it", found="none")

"""What an adaptation asks of a network: what it learns beside drives, how it goes from file to file, and how it is measured."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, Generic, NamedTuple, TypeVar

from torch import nn

from data.label_proposals.proposed_labels import ProposedLabels
from data.recorded_drive import RecordedDrive
from data.synthetic.collection import SynthConfig
from export.onnx import Exportable
from export.variants import Network
from perception.detection.onnx_model import shipped_model
from perception.types import Progress
from train.cli import TrainingKind

Samples = TypeVar("Samples")
SENSORS = 3  # for each of which synthetic scans are made


class MeasuredClass(NamedTuple):
    """Precision of one class in some frames.

    Attributes:
        labels: Number of labels that count.
        ap: Average precision, 0..1.
        mean_ap: Mean of those at stricter and looser matches.
    """

    labels: int
    ap: float
    mean_ap: float


class Costs(NamedTuple):
    """Times in those of a pass of the network.

    Attributes:
        label: A frame to be labelled.
        synthesis: A synthetic frame.
        sample: A sample to learn.
        rest: Everything else.
    """

    label: float
    synthesis: float
    sample: float
    rest: float


class AdaptedNetwork(ABC, Generic[Samples]):
    """A network that is trained further from a model file.

    Attributes:
        kind: Its training.
        training: Configuration of that training; None for the default.
        out_file: Name of the model file that is written.
        flag: Flag of a run that names such a file.
        title: What is measured, in words.
        costs: What takes how long.
    """

    kind: ClassVar[TrainingKind]
    training: ClassVar[str | None] = None
    out_file: ClassVar[str]
    flag: ClassVar[str]
    title: ClassVar[str]
    costs: ClassVar[Costs]

    @abstractmethod
    def __init__(self, file: Path | None, drive: RecordedDrive) -> None:
        """Open a model file.

        Args:
            file: Model file to start from; None for that of this package.
            drive: First drive to adapt to.
        """
        self.file = file or Path(str(shipped_model(Path(self.out_file).stem)))

    @property
    @abstractmethod
    def class_names(self) -> tuple[str, ...]:
        """Classes of the network."""

    @property
    @abstractmethod
    def runner(self) -> Network:
        """The network of the file."""

    @abstractmethod
    def pass_ms(self) -> float:
        """Return the time of a pass of the network."""

    @abstractmethod
    def arguments(self) -> dict[str, object]:
        """Return the flags of the training that depend on the file."""

    @abstractmethod
    def synthetic(self, scans: int, seed: int) -> Mapping[str, SynthConfig]:
        """Return the synthetic drives to learn or to guard, by name; a number of scans for each of three sensors."""

    @abstractmethod
    def load(self, file: Path) -> tuple[nn.Module, dict[str, str]]:
        """Return the network of a checkpoint or model file, and what that states; raise ModelError."""

    @abstractmethod
    def exportable(self, network: Any, metadata: Mapping[str, str]) -> Exportable:  # noqa: ANN401 - as `load` returns it
        """Return a network with the metadata of its model file."""

    @abstractmethod
    def content(self, exportable: Exportable, examples: Samples) -> bytes:
        """Return the model file of a network.

        Args:
            exportable: Network.
            examples: Samples by which its numbers may be scaled.
        """

    @abstractmethod
    def samples(
        self, drives: Sequence[RecordedDrive], count: int, proposals: Mapping[str, ProposedLabels]
    ) -> Samples:
        """Return a number of frames of drives with their labels, evenly spread.

        Args:
            drives: Drives.
            count: Largest number.
            proposals: Proposed labels by the name of a drive, in place of its own.
        """

    @abstractmethod
    def measure(
        self, networks: Mapping[str, Network], samples: Samples, progress: Progress
    ) -> dict[str, dict[str, MeasuredClass]]:
        """Return the precision of some networks by their name and class."""

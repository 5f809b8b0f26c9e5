"""From the flags of a command to a training of a detector; what needs torch is imported here."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from data.frames import OnBadFrame
from data.splitting import SplitBy
from perception.cli.flags import require_drives
from perception.cli.progress import frame_progress_bar
from perception.cli.training.trainer_choice import write_training_configuration
from perception.detection.detectors.input_size import InputSize
from perception.detection.detectors.modalities import MapFilling
from perception.types import Modality

if TYPE_CHECKING:
    from data.images.datamodule import ImageDataModule
    from train.detector.run import TrainedDetector
    from train.detector.training import DetectorTrainingConfig
    from train.trainer import TrainerConfig


@dataclass(frozen=True)
class DetectorDataConfig:
    """What a detector is shown.

    Attributes:
        drives: labelled drives that it learns from.
        validation: drives that it is judged by; none keeps a share of the frames back.
        validation_fraction: of the frames or drives.
        test_fraction: of them, that is kept out of both.
        split: keep single frames back, or whole drives.
        lists: files of frame numbers to learn from and to judge by, instead of the shares.
        jpeg: quality of the JPEG that pictures are pressed through, or None.
        augment: whether pictures are changed at every look.
        batch: pictures a step; None takes that of the preset.
        workers: processes that make samples.
        on_bad_frame: stop at a damaged frame, or leave it out.
        cache: folder for the pictures; else the user's cache folder.
        training_fraction: of the frames that are left to learn from, the first.
    """

    drives: tuple[Path, ...]
    validation: tuple[Path, ...] = ()
    validation_fraction: float = 0.2
    test_fraction: float = 0.0
    split: SplitBy = "frames"
    lists: tuple[Path, Path] | None = None
    jpeg: int | None = None
    augment: bool = True
    batch: int | None = None
    workers: int = 0
    on_bad_frame: OnBadFrame = "stop"
    cache: Path | None = None
    training_fraction: float = 1.0

    def __post_init__(self) -> None:
        """Refuse nothing to learn from."""
        require_drives(self.drives)


@dataclass(frozen=True)
class DetectorModelConfig:
    """Which detector, and how it learns; None takes what the preset says.

    Attributes:
        modality: rgb, dm or rm.
        network: compact, yolov2, or a classifier of torchvision as trunk.
        size: of its input.
        classes: names with commas between them.
        filling: how maps are made dense.
        preset: default, or thesis for the figures of 7.2.2.
        box_loss: squared or ciou.
        objectness: squared or focal.
        learning_rate: the highest.
        anchors: fitted to the labels, or those of the network.
    """

    modality: Modality
    network: str = "compact"
    size: str = "192x640"
    classes: str = "Car"
    filling: MapFilling = "default"
    preset: Literal["default", "thesis"] = "default"
    box_loss: Literal["squared", "ciou"] | None = None
    objectness: Literal["squared", "focal"] | None = None
    learning_rate: float | None = None
    anchors: Literal["auto", "default"] = "auto"


@dataclass(frozen=True)
class InitialWeightsConfig:
    """Where a training starts; without any, from random weights.

    Attributes:
        start: checkpoint of a training of the same network on other pictures.
        darknet_weights: weight file of Darknet.
        backbone_weights: file of a torchvision classifier's weights, or download.
    """

    start: Path | None = None
    darknet_weights: Path | None = None
    backbone_weights: str | None = None


def run_training(
    images: DetectorDataConfig,
    model: DetectorModelConfig,
    initial: InitialWeightsConfig,
    trainer: "TrainerConfig",
    out: Path,
    resume: str | None = None,
) -> "TrainedDetector | None":
    """Train a detector in a folder; return what came of it, in the first process only."""
    from train.detector.run import InitialWeights, train_detector
    from train.trainer import checkpoint_to_resume

    checkpoint = checkpoint_to_resume(out, resume)
    config = detector_training_config(model, images, trainer.seed)
    weights = InitialWeights(
        initial.start, initial.darknet_weights, _backbone(initial.backbone_weights)
    )
    module = image_data(images, model, config, trainer.seed)
    write_training_configuration(
        out,
        data=images,
        loading=module.loading,
        augmentation=module.augmentation,
        network=config,
        first_weights=weights,
        trainer=trainer,
        resumed_from=checkpoint,
    )
    return train_detector(module, config, trainer, out, checkpoint, weights)


def detector_training_config(
    model: DetectorModelConfig, images: DetectorDataConfig, seed: int
) -> "DetectorTrainingConfig":
    """Return which network, and how it descends."""
    from train.detector.networks import DetectorNetworkConfig
    from train.detector.optimizer_config import PRESETS
    from train.detector.training import DetectorTrainingConfig
    from train.revision import program_revision

    preset = PRESETS[model.preset]
    network_config = DetectorNetworkConfig(
        modality=model.modality,
        network=model.network,
        class_names=tuple(name.strip() for name in model.classes.split(",") if name.strip()),
        size=InputSize.parse(model.size),
        filling=model.filling,
    )
    return DetectorTrainingConfig(
        network_config=network_config,
        optimizer_config=replace(
            preset.optimizer_config,
            learning_rate=model.learning_rate or preset.optimizer_config.learning_rate,
        ),
        loss=replace(
            preset.loss,
            box=model.box_loss or preset.loss.box,
            objectness=model.objectness or preset.loss.objectness,
        ),
        anchors=model.anchors,
        seed=seed,
        training_data=", ".join(str(path) for path in images.drives),
        revision=program_revision(),
    )


def image_data(
    images: DetectorDataConfig,
    model: DetectorModelConfig,
    config: "DetectorTrainingConfig",
    seed: int,
) -> "ImageDataModule":
    """Return the batches of a detector."""
    from data.images.augmentation import ImageAugmentationConfig
    from data.images.datamodule import ImageDataModule, ImageLoadingConfig
    from data.images.input_images import ImageConfig
    from data.training_drives import TrainingDrives
    from train.detector.optimizer_config import PRESETS

    network_config = config.network_config
    loading = ImageLoadingConfig(
        batch_size=PRESETS[model.preset].batch_size if images.batch is None else images.batch,
        workers=images.workers,
        validation_fraction=images.validation_fraction,
        test_fraction=images.test_fraction,
        split_by=images.split,
        training_fraction=images.training_fraction,
        frame_lists=images.lists,
        on_bad_frame=images.on_bad_frame,
        seed=seed,
    )
    return ImageDataModule(
        TrainingDrives(images.drives, images.validation, images.cache),
        ImageConfig(
            network_config.modality,
            network_config.class_names,
            network_config.size,
            network_config.filling,
            images.jpeg,
        ),
        ImageAugmentationConfig() if images.augment else None,
        loading,
        frame_progress_bar("pictures"),
    )


def _backbone(words: str | None) -> Path | Literal["download"] | None:
    if words is None:
        return None
    return "download" if words == "download" else Path(words)

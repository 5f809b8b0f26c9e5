"""The detector of the bird's-eye view on its way from a checkpoint to a file."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import torch

from data.array_store import ArrayStore
from data.samples.bev.dataset import BevConfig, BevDataset
from data.samples.bev.labelled_scans import LabelledScans
from export.bev_graph import streamlined
from export.detector import FP32, INT8, choose
from export.detector import QUANTIZATION as OF_IMAGES
from export.onnx import Exportable, to_onnx
from export.quantize import to_int8
from export.result import ExportConfig, ExportResult
from export.variants import Arrays, Network, compare_variants, torch_runner
from perception.atomic_file import write_atomically
from perception.detection.bev.bev_map import BLOCK, CHANNELS
from perception.detection.bev.detector import BevDetector
from perception.errors import UsageError
from perception.sensor import HDL_64E, LidarModel
from perception.types import Progress
from train.bev.metrics import CenterPrecision, FoundCenters, measure
from train.bev.networks import BevNetworkConfig, load_bev
from train.networks.bev_centers import BevCenters, of_whole_numbers

# Unlike those of images the first layers have channels enough for kernels of 8 bits; maps are full of the largest number.
QUANTIZATION = replace(OF_IMAGES, layers=(*OF_IMAGES.layers, "Gemm"), first=False, reduce_range=True)  # fmt: skip
# Of logits; of sides of a place, metres, sines, and logarithms.
TOLERANCES = {"scores": 1e-3, "boxes": 0.01}
_NOISE_ROWS = (1, 2)
_CALIBRATION_FRAMES = 32
_COMPARED_FRAMES = 8
_FILLED = 0.02  # share of the cells of noise that hold something


def export_bev(config: ExportConfig) -> ExportResult:
    """Make the model files of a checkpoint, compare all variants on the same scans, and choose one.

    Raises:
        ModelError: the checkpoint is damaged, or of another network.
        UsageError: 8 bits without a drive, or another size than the network's is asked for.
        PerceptionError: a frame of the drive cannot be read.
    """
    if config.int8 and config.drive is None:
        raise UsageError("int8", expected="a drive to find its scales with", found="none")
    if config.size is not None:
        raise UsageError("size", expected="none, as a map has one size", found=str(config.size))
    exportable = exportable_bev(config.checkpoint)
    shape = exportable.inputs["maps"].shape[1:]
    generator = np.random.default_rng(0)
    noise: list[Arrays] = [random_maps((rows, *shape), generator) for rows in _NOISE_ROWS]
    inputs, models = {"noise": noise}, {FP32: to_onnx(exportable)}
    sensor = config.drive.sensor if config.drive else HDL_64E
    with TemporaryDirectory() as folder:
        opened = {FP32: _open(models[FP32], Path(folder, "fp32.onnx"), sensor)}
        frames = config.read("calibration", _CALIBRATION_FRAMES)
        if maps := [{"maps": opened[FP32].preprocess(frame.points_velo)} for frame in frames]:
            inputs["maps"] = list(maps[:_COMPARED_FRAMES])
        if config.int8:
            models[INT8] = to_int8(models[FP32], maps, QUANTIZATION)
            opened[INT8] = _open(models[INT8], Path(folder, "int8.onnx"), sensor)
        networks: dict[str, Network] = {name: one.model for name, one in opened.items()}
        variants = compare_variants(
            exportable,
            {name: (len(models[name]), network) for name, network in networks.items()},
            inputs,
            timed=inputs.get("maps", noise)[0],
        )
        networks = {"torch": torch_runner(exportable)} | networks
        precision = _measure_variants(config, networks, opened[FP32], Path(folder))
    variants = {
        name: replace(variant, precision=precision.get(name, {}))
        for name, variant in variants.items()
    }
    return ExportResult(
        metadata=dict(exportable.metadata),
        models={name: streamlined(model) for name, model in models.items()},
        variants=variants,
        tolerances=TOLERANCES,
        choice=choose(variants, INT8 if config.int8 else None),
        timed_input="one scan on one thread",
    )


def exportable_bev(checkpoint: Path) -> Exportable:
    """Return the network of a checkpoint with the metadata of its model file.

    Raises:
        ModelError: the checkpoint is damaged, or of another network.
    """
    return exportable_network(*load_bev(checkpoint))


def exportable_network(network: BevCenters, metadata: Mapping[str, str]) -> Exportable:
    """Return a network with the metadata of its model file."""
    side = BevNetworkConfig.from_metadata(metadata).grid.side // BLOCK
    shape = (2, side, side, BLOCK**2, CHANNELS)
    example = random_maps(shape, np.random.default_rng(0))["maps"]
    return Exportable(
        of_whole_numbers(network),
        {"maps": torch.from_numpy(example)},
        outputs=("scores", "boxes"),
        metadata=metadata,
    )


def random_maps(shape: tuple[int, ...], generator: np.random.Generator) -> Arrays:
    """Return maps of the shape (rows, R / 4, R / 4, 16, C), as sparse as those of scans."""
    values = generator.integers(0, 256, shape, dtype=np.uint8)
    return {"maps": values * (generator.random(shape[:4]) < _FILLED)[..., None]}


def _open(data: bytes, file: Path, sensor: LidarModel) -> BevDetector:
    write_atomically(file, data)
    return BevDetector(file, sensor, threads=1)


def _measure_variants(
    config: ExportConfig, networks: Mapping[str, Network], detector: BevDetector, cache: Path
) -> dict[str, dict[str, dict[str, float]]]:
    """Return average precision in percent by variant and class; nothing without a labelled drive."""
    drive = config.drive
    if drive is None or not drive.has_labels:
        return {}
    stated = BevNetworkConfig.from_metadata(detector.model.metadata)
    scans = LabelledScans([drive], stated.grid, ArrayStore(cache))
    numbers = [frame.index for frame in config.read("precision")]
    samples = BevDataset(scans, np.array(numbers), BevConfig(stated.grid, stated.class_names))
    return {
        name: {of_class: {"ap": 100 * one.ap} for of_class, one in found.items() if one.labels}
        for name, found in measure_networks(networks, samples, detector).items()
    }


def measure_networks(
    networks: Mapping[str, Network],
    samples: BevDataset,
    detector: BevDetector,
    progress: Progress = iter,
) -> dict[str, dict[str, CenterPrecision]]:
    """Return the precision of networks of the same input by their name and class.

    Args:
        networks: Networks.
        samples: Maps and labels.
        detector: What makes boxes of the outputs.
        progress: Wrapper of the loop over samples.
    """
    found = {name: FoundCenters() for name in networks}
    for row in progress(range(len(samples))):
        sample = samples[row]
        for name, network in networks.items():
            outputs = network({"maps": sample["maps"].numpy()[None]})
            found[name].update([detector.postprocess(outputs)], sample["numbers"][None], 0)
    targets = [samples.targets(row) for row in range(len(samples))]
    names = samples.config.class_names
    return {name: measure(targets, rows.compute(), names) for name, rows in found.items()}

"""The detector from above beside one pass of a public camera network, and a sample of its training."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.camera_detectors import public_file
from benchmarks.measure import Comparison, Contender, add_peer, compare
from benchmarks.stages import PreparedDrive
from data.array_store import ArrayStore
from data.samples.bev.config import BevAugmentationConfig
from data.samples.bev.dataset import BevConfig, BevDataset
from data.samples.bev.labelled_scans import LabelledScans
from data.samples.epoch_samplers import SampleIndex
from perception.detection.bev.detector import BevDetector
from perception.detection.networks import SHIPPED_BEV
from perception.detection.onnx_model import OnnxModel, shipped_model

_PASS_PX = 416


def compare_bev(prepared: PreparedDrive) -> Comparison:
    """Detect in scans by the network of this package, on one thread."""
    scans = [frame.points_velo for frame in prepared.frames]
    detector = BevDetector(shipped_model(SHIPPED_BEV), prepared.drive.sensor, threads=1)
    with TemporaryDirectory() as folder:
        contenders = [Contender("Trifuse, scan to boxes", lambda i: detector.detect(scans[i]))]
        add_peer(contenders, _camera_network)
        if prepared.drive.has_labels:
            contenders.append(_training_sample(prepared, Path(folder)))
        title = f"detector from above on {len(scans)} scans, one thread"
        return compare(title, contenders, len(scans))


def _camera_network() -> Contender:
    model = OnnxModel(public_file("yolox_nano.onnx"), threads=1)
    [name] = model.inputs
    image = np.full((1, 3, _PASS_PX, _PASS_PX), 114, np.float32)
    return Contender(f"YOLOX-nano, one pass of {_PASS_PX}x{_PASS_PX}", lambda _: model({name: image}))  # fmt: skip


def _training_sample(prepared: PreparedDrive, folder: Path) -> Contender:
    """Make a sample as a worker of the loader does: its samples per second and core follow from its time."""
    config = BevConfig()
    scans = LabelledScans([prepared.drive], config.grid, ArrayStore(folder))
    rows = np.arange(len(prepared.frames))
    samples = BevDataset(scans, rows, config, BevAugmentationConfig())
    for row in rows.tolist():
        scans.scan(row)  # once from disk, as before the first epoch
    return Contender("training sample, augmented", lambda i: samples[SampleIndex(i, (0, i))])

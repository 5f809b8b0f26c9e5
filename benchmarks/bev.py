"""The detector from above beside one pass of a public camera network, and a sample of its training."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import torch

from benchmarks.camera_detectors import public_file
from benchmarks.measure import Comparison, Contender, add_peer, compare
from benchmarks.stages import PreparedDrive
from data.array_store import ArrayStore
from data.samples.bev.config import BevAugmentationConfig
from data.samples.bev.dataset import BevDataset
from data.samples.bev.labelled_scans import LabelledScans
from data.samples.epoch_samplers import SampleIndex
from export.bev import QUANTIZATION
from export.onnx import Exportable, to_onnx
from export.quantize import to_int8
from perception.detection.bev.bev_map import BevMapper
from perception.detection.bev.detector import BevDetector
from perception.detection.onnx_model import OnnxModel
from train.bev.networks import BevNetworkConfig, make_network
from train.networks.bev_centers import DecodedCenters

_PASS_PX = 416
_SHOWN = 8
_LIKELY = 5000  # scores from 0.05 on, as in a busy street


def compare_bev(prepared: PreparedDrive) -> Comparison:
    """Detect in scans by a network of random weights in 8 bits, on one thread."""
    scans = [frame.points_velo for frame in prepared.frames]
    with TemporaryDirectory() as folder:
        file = Path(folder, "bev.onnx")
        file.write_bytes(_network(prepared))
        detector = BevDetector(file, prepared.drive.sensor, threads=1)
        contenders = [Contender("Trifuse, scan to boxes", lambda i: detector.detect(scans[i]))]
        add_peer(contenders, _camera_network)
        if prepared.drive.has_labels:
            contenders.append(_training_sample(prepared, Path(folder)))
        title = f"detector from above on {len(scans)} scans, one thread"
        return compare(title, contenders, len(scans))


def _network(prepared: PreparedDrive) -> bytes:
    config = BevNetworkConfig()
    mapper, maps = BevMapper(prepared.drive.sensor, config.grid), []
    for frame in prepared.frames[:_SHOWN]:
        points_velo = frame.points_velo
        heights_m = np.asarray(mapper.ground(points_velo).distance_m(points_velo), np.float32)
        maps.append(mapper.make(points_velo, heights_m)[None])
    torch.manual_seed(0)
    network, batch = make_network(config), torch.from_numpy(np.concatenate([maps[0]] * 2))
    with torch.no_grad():
        network.train()(batch)
        logits = network.eval()(batch[:1]).scores.flatten()
        bias = network.score_head[-1].bias
        assert isinstance(bias, torch.Tensor)  # which every prediction has
        bias += float(np.log(0.05 / 0.95)) - logits.sort(descending=True).values[_LIKELY]
    model = to_onnx(Exportable(DecodedCenters(network).eval(), {"maps": batch}, ("scores", "boxes"), config.metadata))  # fmt: skip
    return to_int8(model, [{"maps": one} for one in maps], QUANTIZATION)


def _camera_network() -> Contender:
    model = OnnxModel(public_file("yolox_nano.onnx"), threads=1)
    [name] = model.inputs
    image = np.full((1, 3, _PASS_PX, _PASS_PX), 114, np.float32)
    return Contender(f"YOLOX-nano, one pass of {_PASS_PX}x{_PASS_PX}", lambda _: model({name: image}))  # fmt: skip


def _training_sample(prepared: PreparedDrive, folder: Path) -> Contender:
    """Make a sample as a worker of the loader does: its samples per second and core follow from its time."""
    config = BevNetworkConfig()
    scans = LabelledScans([prepared.drive], config.grid, ArrayStore(folder))
    rows = np.arange(len(prepared.frames))
    samples = BevDataset(scans, rows, config, BevAugmentationConfig())
    for row in rows.tolist():
        scans.scan(row)  # once from disk, as before the first epoch
    return Contender("training sample, augmented", lambda i: samples[SampleIndex(i, (0, i))])

"""Checkpoints that are damaged, or something else: one sentence that names the file."""

import io
import pickle
import zipfile

import numpy as np
import pytest
import torch

from export.exporters import export_network
from export.result import ExportConfig
from perception.errors import ModelError
from tests.faults import fault
from train.checkpoints import read_checkpoint
from train.detector.networks import load_detector
from train.fusion.network import load_fusion
from train.networks.depthcn import load_verifier

LOADERS = {"detector": load_detector, "depthcn": load_verifier, "fusion": load_fusion}


def saved(content):
    data = io.BytesIO()
    torch.save(content, data)
    return data.getvalue()


def checkpoint(model="depthcn", **changes):
    content = {"state_dict": {}, "hyper_parameters": {"model": model}, "epoch": 0}
    return saved(content | changes)


def zipped(**files):
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w") as file:
        for name, content in files.items():
            file.writestr(name, content)
    return data.getvalue()


WEIGHTS = checkpoint(state_dict={"network.a": torch.arange(4096.0)})
UNREADABLE = {
    "empty": b"",
    "text": b"no checkpoint at all",
    "cut": WEIGHTS[: len(WEIGHTS) // 2],
    "cut at its end": WEIGHTS[:-30],
    "overwritten in the middle": WEIGHTS[:3000] + bytes(3000) + WEIGHTS[6000:],
    "random bytes": np.random.default_rng(0).bytes(4000),
    "begins as a pickle": pickle.dumps({"epoch": 1})[:-4] + b"cos\nsystem\n",
    "memo": b"\x80\x02h\x95\x15\x6b\x0a.",
    "zip of something else": zipped(text="hello"),
    "other archive": zipped(**{"archive/data.pkl": "hello", "archive/version": "3"}),
    "pickle of numbers": pickle.dumps({"a": 1}, 2),
    "pickle of code": pickle.dumps(np.random.default_rng(0)),
}


@pytest.mark.parametrize("model", LOADERS)
@pytest.mark.parametrize("content", UNREADABLE.values(), ids=UNREADABLE)
def test_a_damaged_checkpoint_is_named(tmp_path, model, content):
    path = tmp_path / "best.ckpt"
    path.write_bytes(content)
    with fault(ModelError, "best.ckpt", f"a checkpoint of {model}", "a file that cannot be read"):
        LOADERS[model](path)


OTHERS = {
    "no dictionary": (saved([1, 2]), "a file without state_dict, hyper_parameters, epoch"),
    "weights alone": (saved({"a": torch.ones(2)}), "a file without state_dict"),
    "odd hyperparameters": (checkpoint(hyper_parameters=[3]), "a file without hyper_parameters"),
    "no epoch": (checkpoint(epoch=None), "a file without epoch"),
    "another model": (checkpoint("sonar"), "one of sonar"),
    "no model": (checkpoint(None), "one of None"),
}


@pytest.mark.parametrize(("content", "found"), OTHERS.values(), ids=OTHERS)
def test_a_file_of_another_kind_is_named(tmp_path, content, found):
    path = tmp_path / "best.ckpt"
    path.write_bytes(content)
    with fault(ModelError, "best.ckpt", "a checkpoint of detector or fusion", found):
        read_checkpoint(path, "detector", "fusion")


@pytest.mark.parametrize("model", LOADERS)
def test_hyperparameters_of_another_program_are_named(tmp_path, model):
    path = tmp_path / "best.ckpt"
    path.write_bytes(checkpoint(model))
    with fault(ModelError, "best.ckpt", f"hyperparameters of a {model}", "others"):
        LOADERS[model](path)


@pytest.mark.parametrize("model", LOADERS)
def test_a_missing_checkpoint_is_named(tmp_path, model):
    with fault(ModelError, "gone.ckpt", found="no such file"):
        LOADERS[model](tmp_path / "gone.ckpt")


def test_an_unknown_network_is_named_by_its_file(tmp_path):
    path = tmp_path / "best.ckpt"
    metadata = {"modality": "dm", "network": "resnet19", "classes": "Car", "filling": "default"}
    sizes = {"input_height": "64", "input_width": "96"}
    hyper_parameters = {"model": "detector", **metadata, **sizes}
    path.write_bytes(checkpoint(hyper_parameters=hyper_parameters))
    with fault(ModelError, "best.ckpt", found="resnet19"):
        export_network(ExportConfig(path))


class _Code:
    def __reduce__(self):
        return (print, ("ran",))


def test_a_checkpoint_never_runs_code(tmp_path, capsys):
    path = tmp_path / "best.ckpt"
    path.write_bytes(checkpoint(hyper_parameters={"model": _Code()}))
    with fault(ModelError, "best.ckpt", found="a file that cannot be read"):
        load_verifier(path)
    assert "ran" not in capsys.readouterr().out

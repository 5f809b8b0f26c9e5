"""Two processes train one network together."""

import json

from tests.train.together import train_together
from train.networks.depthcn import load_verifier

SCRIPT = """
import json, sys
from pathlib import Path
import torch
from tests.train.toy_crops import ToyCrops
from train.config import TrainingRun
from train.folder import TrainingFolder
from train.trainer import fit
from train.verifier.config import VERIFIER_CONFIGS
from train.verifier.run import RANKING
from train.verifier.training import VerifierTraining
torch.set_num_threads(1)
torch.manual_seed(0)
module, run = VerifierTraining(VERIFIER_CONFIGS["default"]), TrainingRun(epochs=1, accelerator="cpu", devices=2)
best, trainer = fit(module, ToyCrops(), RANKING, run, TrainingFolder(Path(sys.argv[1]))), module.trainer
if best is not None:
    metrics = {name: float(value) for name, value in trainer.callback_metrics.items()}
    print(json.dumps({"processes": trainer.world_size, "steps": trainer.global_step, **metrics}))
"""


def test_two_processes_train_one_network(tmp_path):
    printed = train_together(SCRIPT, tmp_path)
    found = json.loads(printed[-1])
    assert (found["processes"], found["steps"]) == (2, 2)  # 32 samples in batches of 8, halved
    assert 0 <= found["validation/accuracy"] <= 1
    network, _ = load_verifier(tmp_path / "out" / "last.ckpt")
    assert not network.training

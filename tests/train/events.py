"""What TensorBoard shows of a training, read back from its files."""

from pathlib import Path
from typing import Any

import yaml
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from tensorboard.plugins.hparams.plugin_data_pb2 import HParamsPluginData

COSTS = {"speed/samples_per_s", "memory/process_gb", "train/gradient_norm"}


def hyperparameters_of(folder: Path) -> tuple[dict[str, Any], dict[str, float]]:
    """Return the hyperparameters and the metrics of a training in TensorBoard's HPARAMS table."""
    events = EventAccumulator(str(folder)).Reload()

    def data(tag: str) -> HParamsPluginData:
        content = events.SummaryMetadata(f"_hparams_/{tag}").plugin_data.content
        return HParamsPluginData.FromString(content)

    values = data("session_start_info").session_start_info.hparams
    shown = {name: getattr(value, value.WhichOneof("kind")) for name, value in values.items()}
    tags = [one.name.tag for one in data("experiment").experiment.metric_infos]
    return shown, {tag: events.Scalars(tag)[-1].value for tag in tags}


def require_costs(folder: Path, epochs: int) -> None:
    """Check speed, memory and gradients of each epoch, and that any program reads hparams.yaml."""
    events = EventAccumulator(str(folder)).Reload()
    for name in COSTS:
        values = [event.value for event in events.Scalars(name)]
        assert len(values) == epochs
        assert min(values) > 0
    yaml.safe_load((folder / "hparams.yaml").read_text())

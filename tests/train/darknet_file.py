"""Weight files as Darknet writes them."""

import struct
from pathlib import Path

import numpy as np
from torch import nn

from train.detector.darknet_weights import weight_slots

HEADER = struct.pack("<3iQ", 0, 2, 5, 2**40)  # version 0.2.5, images seen


def save_darknet_weights(network: nn.Module, path: Path, header: bytes = HEADER) -> None:
    """Write a network as a weight file."""
    numbers = [slot.detach().numpy().astype(np.float32).tobytes() for slot in weight_slots(network)]
    path.write_bytes(header + b"".join(numbers))

"""How long forms of a network take beside each other."""

import time
from collections.abc import Mapping

from export.parity import Arrays, Network


def fastest_ms(networks: Mapping[str, Network], batch: Arrays, rounds: int = 7) -> dict[str, float]:
    """Let all take turns; return the fastest run of each, which other work on the machine disturbs least."""
    fastest = dict.fromkeys(networks, float("inf"))
    for _ in range(rounds):
        for name, network in networks.items():
            start = time.perf_counter()
            network(batch)
            fastest[name] = min(fastest[name], 1e3 * (time.perf_counter() - start))
    return fastest

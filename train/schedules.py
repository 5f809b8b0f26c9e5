"""How the learning rate goes over a training: its share of the highest, a number a step."""

import math


def step_decay(step: int, steps_per_stage: int, factor: float = 0.1) -> float:
    """Return 1 in the first stage, and so much less in each that follows."""
    return float(factor ** (step // max(steps_per_stage, 1)))


def warmup_cosine(step: int, steps: int, warm: float = 0.1, last: float = 0.001) -> float:
    """Return a share that rises over the first steps, then falls along half a cosine.

    Args:
        step: of the training, from 0.
        steps: of the whole training.
        warm: the share of the steps in which it rises.
        last: what is left at the end.
    """
    done = min((step + 1) / max(steps, 1), 1.0)
    if done < warm:
        return done / warm
    fallen = (1 - math.cos(math.pi * (done - warm) / (1 - warm))) / 2
    return 1 - (1 - last) * fallen


def burn_in_steps(step: int, steps: int) -> float:
    """Return a share that rises fast at first, and falls to a tenth at two places.

    `yolo-voc.cfg` has 80200 steps: the rate rises with the fourth power over 1000, and falls after
    40000 and after 60000. Here these are the same shares of any number of steps.
    """
    done = (step + 1) * 80_200 / max(steps, 1)
    if done < 1000:
        return float((done / 1000) ** 4)
    return 0.1 ** ((done > 40_000) + (done > 60_000))

"""Which epoch of a training is the best, and when a training stops."""

import math
from types import SimpleNamespace

import pytest

from train.best_epoch import BestEpoch, Criterion

RANKING = (Criterion("ap"), Criterion("ap_50"), Criterion("loss", is_lower_better=True))


class Epochs:
    """A trainer that logs given metrics."""

    fast_dev_run = should_stop = False
    check_val_every_n_epoch = 1

    def __init__(self, rows, folder):
        self.rows, self.saved, self.default_root_dir = rows, [], folder

    def run(self, callback):
        for number, row in enumerate(self.rows):
            self.number = self.current_epoch = number
            self.callback_metrics = dict(zip(("ap", "ap_50", "loss"), row, strict=True))
            callback.on_train_epoch_end(self, SimpleNamespace(ranking=RANKING))
            if self.should_stop:
                break
        return [number for number, name in self.saved if name == "best.ckpt"]

    def save_checkpoint(self, path):
        self.saved.append((self.number, path.name))


@pytest.mark.parametrize(
    ("rows", "best"),
    [
        ([(0, 1, 9), (0, 2, 9), (0, 1, 1)], [0, 1]),
        ([(0, 0, 3), (0, 0, 4), (0, 0, 2)], [0, 2]),
        ([(1, 0, 9), (2, 0, 9), (1, 9, 1)], [0, 1]),
        ([(1, 1, 1), (1, 1, 1)], [0]),
        ([(0, 0, math.nan), (0, 0, 5), (math.nan, 9, 1)], [0, 1]),
    ],
    ids=["ap of a half", "loss", "first criterion", "the first of equals", "not finite"],
)
def test_each_criterion_decides_where_those_before_are_equal(tmp_path, rows, best):
    epochs = Epochs(rows, tmp_path)
    assert epochs.run(BestEpoch()) == best
    assert [number for number, name in epochs.saved if name == "last.ckpt"] == [*range(len(rows))]


def test_an_epoch_without_validation_is_none_of_the_best(tmp_path):
    epochs = Epochs([(9, 9, 1), (1, 1, 1), (8, 8, 1), (2, 2, 1)], tmp_path)
    epochs.check_val_every_n_epoch = 2
    assert epochs.run(BestEpoch(patience=1)) == [1, 3]
    assert [number for number, name in epochs.saved if name == "last.ckpt"] == [0, 1, 2, 3]


def test_training_stops_by_the_same_order(tmp_path):
    epochs = Epochs([(0, 1, 5), (0, 2, 5), (0, 1, 4), (0, 2, 6), (0, 3, 1)], tmp_path)
    assert epochs.run(BestEpoch(patience=2)) == [0, 1]
    assert epochs.number == 3


def test_a_resumed_training_knows_its_best_epoch(tmp_path):
    first, second = BestEpoch(patience=2), BestEpoch(patience=2)
    Epochs([(5, 5, 1), (4, 4, 1)], tmp_path).run(first)
    second.load_state_dict(first.state_dict())
    epochs = Epochs([(3, 9, 1), (9, 9, 1)], tmp_path)
    assert epochs.run(second) == []
    assert epochs.number == 0

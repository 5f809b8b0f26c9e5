"""Shares of several processes: all of an epoch, none twice, and each its own part of both classes."""

import numpy as np

from data.samples.epoch_samplers import BalancedSampler, DistributedBatchSampler

BATCH_SIZE = 4


def rows_of(shares):
    return [[ask.row for ask in share] for share in shares]


def shares_of(count, processes, epoch=0):
    is_vehicle = np.arange(count) % 2 == 0
    shares = [
        DistributedBatchSampler(BalancedSampler(is_vehicle), BATCH_SIZE, p, processes)
        for p in range(processes)
    ]
    for share in shares:
        share.set_epoch(epoch)
    return shares


def test_processes_share_an_epoch_without_overlap():
    first, second = rows_of(shares_of(20, 2))
    assert sorted(first + second) == list(range(20))


def test_the_batches_of_a_step_have_the_members_of_one_batch_of_all_processes_size():
    whole = [ask.row for ask in BalancedSampler(np.arange(28) % 2 == 0)]
    shares = rows_of(shares_of(28, 3))
    for step, first in enumerate(range(0, 24, 3 * BATCH_SIZE)):
        members = [row for rows in shares for row in rows[step * BATCH_SIZE :][:BATCH_SIZE]]
        assert members == whole[first : first + 3 * BATCH_SIZE]
    assert [rows[8:] for rows in shares] == [whole[24:25], whole[25:26], whole[26:27]]


def test_every_process_gets_both_classes_alike():
    for rows in rows_of(shares_of(24, 3)):
        assert sum(row % 2 for row in rows) == len(rows) / 2 == 4


def test_all_are_as_long_where_items_cannot_be_shared_out():
    shares = shares_of(22, 4)
    assert [len(share) for share in shares] == [len(r) for r in rows_of(shares)] == [5] * 4


def test_the_epoch_reaches_the_sampler():
    assert rows_of(shares_of(20, 2, epoch=0)) != rows_of(shares_of(20, 2, epoch=1))
    assert rows_of(shares_of(20, 2, epoch=1)) == rows_of(shares_of(20, 2, epoch=1))

"""Shares of several processes: all of an epoch, none twice, and each its own part of both classes."""

import numpy as np

from data.samples.epoch_samplers import BalancedSampler, ContiguousDistributedSampler


def rows_of(shares):
    return [[ask.row for ask in share] for share in shares]


def shares_of(count, processes, epoch=0):
    is_vehicle = np.arange(count) % 2 == 0
    shares = [
        ContiguousDistributedSampler(BalancedSampler(is_vehicle), p, processes)
        for p in range(processes)
    ]
    for share in shares:
        share.set_epoch(epoch)
    return shares


def test_processes_share_an_epoch_without_overlap():
    first, second = rows_of(shares_of(20, 2))
    assert sorted(first + second) == list(range(20))


def test_every_process_gets_both_classes_alike():
    for rows in rows_of(shares_of(24, 3)):
        assert sum(row % 2 for row in rows) == len(rows) / 2 == 4


def test_all_are_as_long_where_items_cannot_be_shared_out():
    shares = shares_of(22, 4)
    assert [len(share) for share in shares] == [len(r) for r in rows_of(shares)] == [5] * 4


def test_the_epoch_reaches_the_sampler():
    assert rows_of(shares_of(20, 2, epoch=0)) != rows_of(shares_of(20, 2, epoch=1))
    assert rows_of(shares_of(20, 2, epoch=1)) == rows_of(shares_of(20, 2, epoch=1))

"""Compiled loops over arrays, where NumPy would pass over the same points many times.

What may live here: functions of arrays and numbers, without types and configuration of ours, each at least three
times as fast as NumPy on the hot path and equal to a plain reference in the tests. They release Python's lock.
"""

"""The limit on BLAS threads is the whole process'; it must outlast every thread that asked for it."""

from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import numpy as np  # noqa: F401 - brings the BLAS whose threads are counted
from threadpoolctl import threadpool_info

from perception.geometry.threads import limit_blas_threads


def blas_threads():
    return [pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"]


def test_the_limit_stands_until_the_last_has_left():
    both_in, one_out = Barrier(2, timeout=5), Barrier(2, timeout=5)

    def leaves_first():
        with limit_blas_threads():
            both_in.wait()
        one_out.wait()

    def leaves_last():
        with limit_blas_threads():
            both_in.wait()
            one_out.wait()
            return blas_threads()

    with ThreadPoolExecutor(2) as executor:
        first, last = executor.submit(leaves_first), executor.submit(leaves_last)
        first.result()
        assert set(last.result()) <= {1}

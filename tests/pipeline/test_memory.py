"""Threads share few heaps, and a run imports no more than it needs."""

import ctypes
import subprocess
import sys

import pytest

# Threads that allocate at the same time, and the number of heaps that they made.
COUNT_HEAPS = """
import ctypes, re, sys, tempfile, threading
from perception.pipeline.memory import limit_heaps

limit_heaps()
library = ctypes.CDLL(None)
library.malloc.restype = library.fopen.restype = ctypes.c_void_p
barrier = threading.Barrier(8)

def allocate():
    barrier.wait()
    library.malloc(ctypes.c_size_t(50_000))
    barrier.wait()

threads = [threading.Thread(target=allocate) for _ in range(8)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
with tempfile.NamedTemporaryFile() as file:
    stream = ctypes.c_void_p(library.fopen(file.name.encode(), b"w"))
    library.malloc_info(0, stream)
    library.fclose(stream)
    print(len(re.findall(rb"<heap nr=", file.read())))
"""


@pytest.mark.skipif(
    not hasattr(ctypes.CDLL(None), "malloc_info"),
    reason="the heaps of this C library are not known",
)
def test_threads_share_two_heaps():
    ran = subprocess.run(
        [sys.executable, "-c", COUNT_HEAPS], capture_output=True, text=True, check=True
    )
    assert int(ran.stdout) <= 2


def test_a_run_without_a_tracker_of_one_object_imports_none():
    code = (
        "import sys\n"
        "import data.results.run_drive\n"
        "print([name for name in ('scipy.signal', 'matplotlib') if name in sys.modules])"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout == "[]\n"

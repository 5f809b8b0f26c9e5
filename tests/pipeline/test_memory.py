"""Threads share few heaps, frames are freed in time, and a run imports no more than it needs."""

import ctypes
import gc
import subprocess
import sys
import weakref
from dataclasses import replace

import pytest

from perception.pipeline import Pipeline

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


# Memory of the compiler's code in KiB, before and after it is released, and what a function returns that is compiled later.
COMPILE_LATER = """
import re
import numba
from perception.pipeline.memory import release_compiler

def code_kib():
    maps = open("/proc/self/smaps").read()
    return int(re.search(r"r-xp .*libllvmlite.*\\n(?:.*\\n)*?Rss: *(\\d+)", maps)[1])

numba.njit(lambda number: number + 1)(1)
before_kib = code_kib()
release_compiler()
print(before_kib, code_kib(), numba.njit(lambda number: 2 * number)(21))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="the mappings of other systems are not known")
def test_the_code_of_the_compiler_is_released_and_read_again_where_it_is_needed():
    ran = subprocess.run(
        [sys.executable, "-c", COMPILE_LATER], capture_output=True, text=True, check=True
    )
    before_kib, after_kib, doubled = map(int, ran.stdout.split())
    assert before_kib > 20_000
    assert after_kib < 1_000
    assert doubled == 42


@pytest.mark.parametrize("parallel", [False, True])
def test_frames_are_freed_without_collection_of_cycles(all_stages, street_frames, parallel):
    frames = [replace(frame) for frame in street_frames]
    freed = [weakref.ref(frame) for frame in frames]
    gc.disable()
    try:
        with Pipeline(config=replace(all_stages, parallel=parallel)) as pipeline:
            with pipeline.stream(frames.pop(0) for _ in freed) as results:
                for result in results:
                    assert result.frame.index < len(freed)
            del result, results
            # The workers may hold the last one until their next task.
            assert [frame() for frame in freed[:-1]] == [None] * (len(freed) - 1)
    finally:
        gc.enable()


def test_a_run_without_a_tracker_of_one_object_imports_none():
    code = (
        "import sys\n"
        "import data.results.run_drive\n"
        "print([name for name in ('scipy.signal', 'matplotlib') if name in sys.modules])"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout == "[]\n"

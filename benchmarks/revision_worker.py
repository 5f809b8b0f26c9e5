"""The pipeline of one source tree in a process of its own, measured in processor time; see `revisions.py`.

Started by its path with another revision's source tree on PYTHONPATH, so it uses only what every revision has:
`open_drive`, `OpenConfig`, `Pipeline` and `Result.spans`. Each line of its input is a range of frames, `first last`; each line of
its output is the JSON document of their times.
"""

import json
import os
import sys
import time
from pathlib import Path
from typing import Any

SORTED = "sort a million float64"
FRAME = "all of a frame"


def main(path: str, sequence: str = "", sensor: str = "", camera: str = "") -> None:
    """Answer one range of frames after another, until there are no more.

    Args:
        path: Drive, in any layout.
        sequence: Sequence of the drive, empty where it has none.
        sensor: LiDAR model, empty for what the drive states.
        camera: Cameras, with commas between them, empty for the one that the drive states.
    """
    responses = os.fdopen(os.dup(sys.stdout.fileno()), "w")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what is printed is no response
    # Stages are measured in the processor time of their own thread: what else runs on the machine hardly counts.
    time.perf_counter = time.thread_time
    _limit_network_threads()

    from data.layouts import OpenConfig
    from data.open_drive import open_drive
    from perception.pipeline import Pipeline, PipelineConfig

    config = OpenConfig(sensor=sensor or None, camera=camera or None)
    drive = open_drive(Path(path), sequence=sequence or None, config=config)
    with Pipeline(drive.sensor, PipelineConfig(parallel=False)) as pipeline:
        for line in sys.stdin:
            first, last = map(int, line.split())
            sort_s = _time_sort()
            frames = [
                _time_frame(pipeline, drive[index]) for index in range(first, min(last, len(drive)))
            ]
            print(json.dumps([{**frame, SORTED: sort_s} for frame in frames]), file=responses)
            responses.flush()


def _time_frame(pipeline: Any, frame: Any) -> dict[str, float]:  # noqa: ANN401 - of any revision
    """Return the processor time of each stage and of all threads together in seconds."""
    start_s = time.process_time()
    result = pipeline.step(frame)
    frame_s = time.process_time() - start_s
    return {span.stage: span.stop_s - span.start_s for span in result.spans} | {FRAME: frame_s}


def _time_sort() -> float:
    import numpy as np

    values = np.random.default_rng(0).random(1_000_000)
    start_s = time.thread_time()
    np.sort(values)
    return time.thread_time() - start_s


def _limit_network_threads() -> None:
    """Give each network one thread, so that its work is that of the thread which runs the stage."""
    import onnxruntime

    open_session = onnxruntime.InferenceSession

    def open_with_one_thread(content: Any, sess_options: Any, **options: Any) -> Any:  # noqa: ANN401
        sess_options.intra_op_num_threads = 1
        return open_session(content, sess_options, **options)

    onnxruntime.InferenceSession = open_with_one_thread


if __name__ == "__main__":
    main(*sys.argv[1:])

"""Detection and tracking of moving objects: each method, the short-term map, and the filters."""

from dataclasses import replace
from itertools import cycle, islice

import numpy as np

from benchmarks.measure import Comparison, Contender, compare
from benchmarks.reference.datmo import ReferenceShortTermMap
from benchmarks.reference.point_tracker import ReferencePointTracker, moving_squares
from benchmarks.stages import PreparedDrive
from perception.datmo.cell_grid import CellGrid
from perception.datmo.config import THESIS, DatmoConfig, DatmoMethod
from perception.datmo.elevation import LevelPlane, elevation_grid
from perception.datmo.short_term_map import ShortTermMap
from perception.datmo.stage import datmo_stage
from perception.geometry.footprints import Footprints
from perception.pipeline import PipelineConfig
from perception.pipeline.lidar_stages import LidarStages
from perception.tracking.point_tracker import PointTracker
from perception.types import Float32

_METHODS: dict[str, DatmoMethod] = {
    "Trifuse": "default",
    "thesis: grids (5.2, Table 7.4)": "thesis",
    "thesis: the author's values": "author",
}
_OBJECTS, _FRAMES = 50, 50


def compare_moving_objects(prepared: PreparedDrive) -> Comparison:
    """Detection and tracking by every method, on the same segmented scans."""
    config = PipelineConfig.for_motion("none")
    chain = LidarStages(prepared.drive.sensor, config)
    scans = [chain.segment(frame)[1] for frame in prepared.frames]

    def contender(name: str, method: DatmoMethod) -> Contender:
        stage = datmo_stage(
            DatmoConfig(method=method), prepared.drive.sensor, config.area_of(prepared.drive.sensor)
        )
        return Contender(name, lambda i: stage.update(scans[i]) if stage else None)

    contenders = [contender(name, method) for name, method in _METHODS.items()]
    return compare("moving objects: detection and tracking", contenders, len(scans))


def compare_short_term_maps(prepared: PreparedDrive) -> Comparison:
    """Put a scan's grid into the map and ask it, with full queues of several lengths."""
    cells = CellGrid.covering(THESIS.work_area, THESIS.cell_m)
    plane = LevelPlane(-prepared.drive.sensor.height_m)
    inputs = [
        (
            elevation_grid(scans.newest.points_velo, plane, cells, THESIS),
            scans.newest.world_SE3_velo,
        )
        for scans in prepared.windows
    ]

    def contender(form: type[ShortTermMap] | type[ReferenceShortTermMap], queue: int) -> Contender:
        config = replace(THESIS, scans=queue, max_observations=min(queue, 30))
        short_term_map = form(cells, config)
        # There and back until the queue is full, as a drive would fill it.
        for grid, pose in islice(cycle([*inputs, *reversed(inputs)]), queue):
            short_term_map.update(grid, pose)

        def run(i: int) -> Float32:
            return short_term_map.update(*inputs[i])

        name = "Trifuse" if form is ShortTermMap else "every grid transformed again"
        return Contender(f"{name}, {queue} in the queue", run)

    contenders = [contender(ShortTermMap, queue) for queue in (50, 10, 200)]
    contenders += [contender(ReferenceShortTermMap, queue) for queue in (50, 10)]
    return compare("short-term map (Algorithm 4)", contenders, len(inputs))


def compare_filters(_: PreparedDrive) -> Comparison:
    """Fifty simulated objects by one batch of filters and by a loop over them."""
    scans, pose, nothing = moving_squares(_OBJECTS, _FRAMES), np.eye(4), Footprints.empty()
    batch, reference = PointTracker(), ReferencePointTracker()
    contenders = [
        Contender("Trifuse", lambda i: batch.update(0.1 * i, pose, scans[i], nothing)),
        Contender(
            "reference: one filter per track",
            lambda i: reference.update(0.1 * i, pose, scans[i], nothing),
        ),
    ]
    return compare("fifty tracks of the thesis' tracker", contenders, _FRAMES)

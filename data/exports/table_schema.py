"""Tables of a run: their columns, with units in the names. `docs/tables.md` shows them; Parquet files carry the descriptions."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

# Names that Arrow, pandas and DuckDB know.
ColumnType: TypeAlias = Literal["int32", "int64", "double", "bool", "string"]


@dataclass(frozen=True)
class TableColumn:
    """One column of a table; null where a value is not known.

    Attributes:
        type: Type of the values.
        description: Meaning of a value.
    """

    type: ColumnType
    description: str


Columns: TypeAlias = Mapping[str, TableColumn]

_FRAME: Columns = {
    "frame": TableColumn("int32", "index of the frame in the drive; joins the tables"),
    "timestamp_ns": TableColumn("int64", "time of the scan"),
}


def _place(frame: str, of: str) -> Columns:
    """Return the columns of an object's place in one frame of reference."""
    axes = {axis: TableColumn("double", f"centre of the bottom face in {of}") for axis in "xyz"}
    speeds = {axis: TableColumn("double", f"velocity along {axis} of {of}") for axis in "xy"}
    return {
        **{f"{axis}_{frame}_m": column for axis, column in axes.items()},
        f"yaw_{frame}_rad": TableColumn("double", "heading from -pi to pi, from x towards y"),
        **{f"v{axis}_{frame}_m_s": column for axis, column in speeds.items()},
    }


_OBJECT: Columns = {
    **_FRAME,
    "track_id": TableColumn("int64", "id, equal in both tables of objects for one object"),
    "category": TableColumn("string", "class of a detector, such as Car"),
    "score": TableColumn("double", "fused score of the last detection, 0 to 1"),
    "length_m": TableColumn("double", "size along the heading"),
    "width_m": TableColumn("double", "size across the heading"),
    "height_m": TableColumn("double", "size upwards"),
    "speed_m_s": TableColumn("double", "speed over the ground"),
    **_place("velo", "the LiDAR's frame"),
    **_place("world", "the world frame of `poses`"),
    "std_x_velo_m": TableColumn("double", "standard deviation of x"),
    "std_y_velo_m": TableColumn("double", "standard deviation of y"),
    "std_vx_velo_m_s": TableColumn("double", "standard deviation of vx"),
    "std_vy_velo_m_s": TableColumn("double", "standard deviation of vy"),
    "std_length_m": TableColumn("double", "standard deviation of the length"),
    "std_width_m": TableColumn("double", "standard deviation of the width"),
    "std_height_m": TableColumn("double", "standard deviation of the height"),
    "std_yaw_rad": TableColumn("double", "standard deviation of the heading modulo pi"),
    "reversal": TableColumn("double", "probability that the front is the rear"),
}

# Columns of each table, by the name of its file.
TABLES: Final[Mapping[str, Columns]] = {
    "frames": {
        **_FRAME,
        "name": TableColumn("string", "name of the frame's result files"),
        "number": TableColumn("int32", "frame number in KITTI's rows"),
        "has_image": TableColumn("bool", "whether the frame has a camera image"),
        "points": TableColumn("int32", "points of the scan"),
        "invalid_points": TableColumn("int32", "points that were no measurement"),
        "outside_points": TableColumn("int32", "points beyond the local area"),
        "ground_points": TableColumn("int32", "points of the ground"),
        "static_points": TableColumn("int32", "points of static obstacles"),
        "moving_points": TableColumn("int32", "points of moving obstacles"),
        "static_voxels": TableColumn("int32", "voxels of the static map"),
        "moving_voxels": TableColumn("int32", "moving voxels"),
        "tracks": TableColumn("int32", "rows of this frame in `tracks`"),
        "vehicles": TableColumn(
            "int32", "rows of this frame in `vehicles`; null without detectors"
        ),
        "latency_s": TableColumn(
            "double", "time from the start of the first stage to the end of the last"
        ),
        "health": TableColumn("string", "OK, WARN or ERROR, the worst of all sensors and stages"),
        "findings": TableColumn("string", "what is wrong, with level and reason; null where OK"),
    },
    "poses": {
        **_FRAME,
        "tx_m": TableColumn("double", "x of the LiDAR in the world frame, after registration"),
        "ty_m": TableColumn("double", "y"),
        "tz_m": TableColumn("double", "z"),
        "qw": TableColumn("double", "rotation of world_SE3_velo as a unit quaternion, w"),
        "qx": TableColumn("double", "x"),
        "qy": TableColumn("double", "y"),
        "qz": TableColumn("double", "z"),
        "std_x_m": TableColumn("double", "standard deviation of x since the first scan"),
        "std_y_m": TableColumn("double", "standard deviation of y"),
        "std_z_m": TableColumn("double", "standard deviation of z"),
        "std_rx_rad": TableColumn(
            "double", "standard deviation of the rotation about the world's x axis"
        ),
        "std_ry_rad": TableColumn("double", "about y"),
        "std_rz_rad": TableColumn("double", "about z"),
    },
    "tracks": {
        **_OBJECT,
        "is_observed": TableColumn("bool", "whether measured in this scan, not predicted"),
    },
    "vehicles": {
        **_OBJECT,
        "existence": TableColumn(
            "double", "probability that the object exists, of its whole track"
        ),
        "camera": TableColumn("string", "camera of the box in the image and of the scores"),
        "x1_px": TableColumn("double", "left edge in the image; null without a camera"),
        "y1_px": TableColumn("double", "upper edge"),
        "x2_px": TableColumn("double", "right edge"),
        "y2_px": TableColumn("double", "lower edge"),
        "dominant_modality": TableColumn(
            "string", "detector with the largest weight: rgb, dm, rm, bev"
        ),
        "score_rgb": TableColumn("double", "score of the camera's detector"),
        "score_dm": TableColumn("double", "score of the depth map's detector"),
        "score_rm": TableColumn("double", "score of the reflectance map's detector"),
        "score_bev": TableColumn("double", "score of the bird's-eye view's detector"),
        "points": TableColumn("int32", "LiDAR points on the vehicle"),
        "distance_m": TableColumn("double", "distance to the nearest return"),
    },
    "timings": {
        **_FRAME,
        "stage": TableColumn("string", "name of the stage"),
        "worker": TableColumn("string", "worker that ran it"),
        "start_s": TableColumn("double", "start since the frame's arrival"),
        "duration_s": TableColumn("double", "duration; null where skipped"),
        "is_skipped": TableColumn("bool", "whether left out to keep the time budget"),
    },
}

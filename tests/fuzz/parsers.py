"""Every parser of a file that comes from outside, with valid files to begin with.

A parser may refuse what it reads by a PerceptionError in one line, and nothing else: no other exception, no hang,
no memory beyond what a whole file of its kind needs.
"""

import io
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np

from perception.detection.detectors.class_columns import COCO_CLASSES
from perception.errors import LabelError, ModelError, PoseError
from tests.damaged_scans import CALIBRATION

Read = Callable[[Path], object]
_POINTS = 12
_RANDOM = np.random.default_rng(0)


@dataclass(frozen=True)
class FileParser:
    """A parser of one file.

    Attributes:
        file: Name of the file, by whose suffix some parsers choose the format.
        read: Reads the file at a path.
        seeds: Returns contents of valid files, one of each form.
        beside: Other files that the parser reads, by their names.
    """

    file: str
    read: Read
    seeds: Callable[[], Sequence[bytes]]
    beside: Mapping[str, Callable[[], bytes]] = field(default_factory=dict)


def _written(write: Callable[[Path], object], file: str) -> bytes:
    """Return what a function writes to a file."""
    with TemporaryDirectory() as folder:
        write(Path(folder) / file)
        return (Path(folder) / file).read_bytes()


def _texts(*texts: str) -> Callable[[], Sequence[bytes]]:
    return lambda: [text.encode() for text in texts]


# --- KITTI ----------------------------------------------------------------------------------------


def _read_scan(path: Path) -> object:
    from data.kitti.sensor_files import read_scan

    return read_scan(path)


def _scans() -> Sequence[bytes]:
    points = _RANDOM.normal(0, 10, (_POINTS, 4)).astype(np.float32)
    points[:, 3] = 0.5
    return [points.tobytes()]


def _read_image(path: Path) -> object:
    from data.kitti.sensor_files import read_image

    return read_image(path)


def _images() -> Sequence[bytes]:
    colour = _RANDOM.integers(0, 256, (6, 9, 3), np.uint8)
    deep = _RANDOM.integers(0, 2**16, (6, 9)).astype(np.uint16)
    forms = ((".png", colour), (".png", colour[..., 0]), (".png", deep), (".jpg", colour))
    return [cv2.imencode(suffix, image)[1].tobytes() for suffix, image in forms]


def _read_point_labels(path: Path) -> object:
    from data.kitti.sensor_files import read_point_truth

    return read_point_truth(path, _POINTS)


def _read_calibration(path: Path) -> object:
    from data.kitti.calibration import read_benchmark_calibration

    return read_benchmark_calibration(path)


def _calibrations() -> Sequence[bytes]:
    from data.kitti.calibration import DriveCalibration, format_benchmark_calibration

    return [format_benchmark_calibration(DriveCalibration(CALIBRATION, np.eye(4))).encode()]


def _read_raw_calibration(path: Path) -> object:
    from data.kitti.calibration import read_raw_calibration

    return read_raw_calibration(path.parent)


_RIGID = "R: 1 0 0 0 1 0 0 0 1\nT: 0.1 0.2 0.3\n"
_CAMERAS = (
    "S_rect_02: 124 38\nR_rect_00: 1 0 0 0 1 0 0 0 1\nP_rect_02: 72 0 61 4 0 72 17 0 0 0 1 0.003\n"
)
_VELO_TO_CAM = "calib_time: 15-Mar-2012 11:37:16\nR: 0 -1 0 0 0 -1 1 0 0\nT: 0 -0.08 -0.27\n"


def _read_packet(path: Path) -> object:
    from data.kitti.oxts import Mercator, parse_oxts_packet
    from data.kitti.reading import read_text

    packet = parse_oxts_packet(read_text(path, PoseError, "an INS packet"), path)
    return Mercator.around(packet).world_SE3_imu(packet)


def _packets() -> Sequence[bytes]:
    from data.kitti.oxts import Mercator, format_oxts_packet

    world, still = Mercator(49.0, 8.4, 110.0), np.zeros(3)
    packet = world.packet(np.eye(4), still, np.array([0, 0, 9.81]), still)
    return [format_oxts_packet(packet).encode()]


_OBJECT = "Car 0.00 0 -1.57 30 12 55 30 1.5 1.8 4.0 1.0 1.7 10.0 -1.47"
_DONT_CARE = "DontCare -1 -1 -10 1 2 3 4 -1 -1 -1 -1000 -1000 -1000 -10"


def _read_object_labels(path: Path) -> object:
    from data.kitti.labels import read_object_labels

    return read_object_labels(path, CALIBRATION)


def _read_tracking_labels(path: Path) -> object:
    from data.kitti.labels import read_tracking_labels

    return read_tracking_labels(path, CALIBRATION)


def _read_label_rows(path: Path) -> object:
    from data.kitti.tracking_rows import read_label_rows

    return read_label_rows(path)


def _read_result_rows(path: Path) -> object:
    from data.kitti.tracking_rows import read_result_rows

    return read_result_rows(path)


def _read_json_results(path: Path) -> object:
    from data.coco_results import parse_coco_detections
    from data.nuscenes.results import parse_sample
    from data.result_files import find_results

    found = find_results(path)
    if found.form == "COCO":
        return parse_coco_detections(path, found.document)
    return [parse_sample(found, sample) for sample in found.document["results"]]


_COCO = {"image_id": 7, "category_id": 3, "bbox": [30, 12, 25.5, 18], "score": 0.9}
_NUSCENES = {"translation": [695.5, 1800, 0.5], "size": [2, 4.5, 1.7], "rotation": [0.8, 0, 0, 0.6]}
_SCENE_RESULTS = [
    {"meta": {}, "results": {"a": [{**_NUSCENES, **named}], "b": []}}
    for named in (
        {"detection_name": "bicycle", "detection_score": 0.5, "attribute_name": "cycle.with_rider"},
        {"tracking_name": "car", "tracking_score": 1, "tracking_id": "7"},
    )
]
_CATEGORIES = {"categories": [{"id": 3, "name": "car"}]}
_IMAGES = [{"id": 7, "file_name": "image_2/000004.png"}]


def _read_categories(path: Path) -> object:
    from data.coco_results import parse_coco_detections

    return parse_coco_detections(path.parent / "found.json", [_COCO])


def _read_seqmap(path: Path) -> object:
    from data.kitti.tracker_files import read_seqmap

    return read_seqmap(path)


def _read_frame_list(path: Path) -> object:
    from data.kitti.detection_rows import read_frame_list

    return read_frame_list(path)


def _read_timestamps(path: Path) -> object:
    from data.kitti.timestamps import read_timestamps

    return read_timestamps(path)


# --- KITTI-360 ------------------------------------------------------------------------------------


def _read_rig(path: Path) -> object:
    from data.kitti360.calibration import RigCalibration

    return RigCalibration.read(path.parent, "image_00")


def _read_stated_poses(path: Path) -> object:
    from data.kitti360.poses import FrameClock, ScanPoses, StatedPoses

    clock = FrameClock(np.arange(_POINTS), np.arange(_POINTS) / 10, 10.0)
    return ScanPoses.of(StatedPoses.read(path), np.eye(4), clock)


def _read_boxes(path: Path) -> object:
    from data.kitti360.bounding_boxes import DriveBoxes

    boxes = DriveBoxes(path)
    return [(boxes.is_annotated(frame), boxes.at(frame)) for frame in range(_FRAMES)]


def _stored_boxes() -> Sequence[bytes]:
    from perception.types import Boxes3D
    from tests.kitti360_writer import Kitti360Object, write_boxes

    box = Boxes3D(np.ones((1, 3)), np.ones((1, 3)), np.ones(1))
    objects = [
        Kitti360Object(label, 1, box, frame, (0, 2))
        for label, frame in (("road", -1), ("car", -1), ("car", 0), ("car", 2))
    ]
    return [_written(lambda path: write_boxes(path, objects), "drive.xml")]


_CAM_TO_VELO = "0 0 1 0.8 -1 0 0 0.1 0 -1 0 -0.2\n"
_CAM_TO_POSE = "image_00: 0 0 1 1.5 1 0 0 0 0 1 0 -0.6\nimage_01: 0 0 1 1.5 1 0 0 0.6 0 1 0 -0.6\n"
_PERSPECTIVE = (
    "S_rect_00: 140 37\nR_rect_00: 1 0 0 0 1 0 0 0 1\nP_rect_00: 55 0 68 0 0 55 23 0 0 0 1 0\n"
)


# --- Clouds ---------------------------------------------------------------------------------------


def _read_cloud(path: Path) -> object:
    from data.clouds.read_cloud import read_cloud

    return read_cloud(path)


def _rows() -> np.ndarray:
    return _RANDOM.normal(0, 10, (_POINTS, 4)).astype(np.float32)


def _pcds() -> Sequence[bytes]:
    import lzf

    rows = _rows()
    header = (
        "VERSION 0.7\nFIELDS x y z intensity\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\n"
        f"WIDTH {_POINTS}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {_POINTS}\nDATA "
    ).encode()
    columns = np.repeat(np.float32([1, 2, 3, 4]), _POINTS).tobytes()
    squeezed = lzf.compress(columns)
    sizes = np.array([len(squeezed), len(columns)], "<u4").tobytes()
    text = "\n".join(" ".join(f"{value:.4f}" for value in row) for row in rows)
    return [
        header + b"ascii\n" + text.encode(),
        header + b"binary\n" + rows.tobytes(),
        header + b"binary_compressed\n" + sizes + squeezed,
        header.replace(b"0 0 0 1 0 0 0", b"1 2 3 0.5 0.5 0.5 0.5") + b"binary\n" + rows.tobytes(),
        header.replace(b"T 1 1 1 1", b"T 1 1 1 0") + b"binary\n" + rows[:, :3].tobytes(),
        b"COLUMNS x y z intensity\nPOINTS %d\nDATA ascii\n" % _POINTS + text.encode(),
    ]


def _plys() -> Sequence[bytes]:
    rows = _rows()
    properties = "".join(f"property float {name}\n" for name in ("x", "y", "z", "intensity"))
    text = "\n".join(" ".join(f"{value:.4f}" for value in row) for row in rows)
    forms = {
        "ascii": text.encode(),
        "binary_little_endian": rows.tobytes(),
        "binary_big_endian": rows.astype(">f4").tobytes(),
    }
    head = f"element vertex {_POINTS}\n{properties}end_header\n"
    return [f"ply\nformat {form} 1.0\n{head}".encode() + body for form, body in forms.items()]


def _npys() -> Sequence[bytes]:
    records = np.zeros(_POINTS, [("x", "f4"), ("y", "f4"), ("z", "f4"), ("ring", "u2")])
    records["x"] = np.arange(_POINTS)
    return [
        _written(lambda path, one=rows: np.save(path, one), "0.npy") for rows in (_rows(), records)
    ]


def _npzs() -> Sequence[bytes]:
    file = io.BytesIO()
    np.savez_compressed(file, points=_rows())
    return [file.getvalue()]


# --- Folders --------------------------------------------------------------------------------------


def _read_drive_file(path: Path) -> object:
    from data.folder.config import FolderConfig
    from data.folder.typed_document import read_document

    return read_document(FolderConfig, path)


_DRIVE_FILE = """\
lidar:
  scans: velodyne
  sensor: VLP-16
  height_m: 1.9
  reflectance_scale: 255
camera:
  images: images
  fx_px: 700.0
  fy_px: 700.0
  cx_px: 640.0
  cy_px: 360.0
  distortion: [0.1, -0.2, 0.0, 0.0, 1e-3]
  lidar_to_camera:
    translation_m: [0.0, -0.1, 0.2]
    roll_pitch_yaw_deg: [0, 0, 90]
poses:
  file: poses.txt
  format: kitti
"""


def _pose_reader(kind: str) -> Read:
    def read(path: Path) -> object:
        from data.folder.pose_track import read_pose_track

        return read_pose_track(path, kind, _FRAMES)  # type: ignore[arg-type]

    return read


_FRAMES = 3


def _read_stamps(path: Path) -> object:
    from data.folder.stamps import read_stamps

    return read_stamps(path, _FRAMES)


def _read_sensor(path: Path) -> object:
    from perception.sensor.files import load_sensor

    return load_sensor(str(path))


# --- Our own files --------------------------------------------------------------------------------


def _read_split(path: Path) -> object:
    from data.splits.files import read_split

    return read_split(path)


_SPLIT = {
    "format": "trifuse split 1",
    "by": "drive",
    "shares": [80, 10, 10],
    "seed": 0,
    "drives": [
        {"root": "kitti", "name": "0000", "train": ["000000", "000001"], "test": ["000002"]}
    ],
}


def _read_flags(path: Path) -> object:
    from data.results.command_config import read_config

    return read_config(path)


def _read_frame_lines(path: Path) -> object:
    from data.results.objects import FrameLine
    from data.results.records import read_records

    return read_records(path, FrameLine)


def _frame_lines() -> Sequence[bytes]:
    from data.results.objects import FrameLine

    lines = [json.dumps(asdict(FrameLine(frame, frame / 10))) for frame in range(_FRAMES)]
    return ["\n".join(lines).encode()]


def _read_counting_sheet(path: Path) -> object:
    from data.results.counted_scans import read_counting_sheet

    return read_counting_sheet(path)


def _counting_sheets() -> Sequence[bytes]:
    from data.results.counted_scans import CountedImage, write_counting_sheet
    from perception.evaluation.obstacle_counts import ObstacleCounts

    counts = ObstacleCounts(4, 2, 1, 0, 0, 0)
    rows = [
        CountedImage("0000", f"{frame:06d}", f"{frame:06d}.png", one)
        for frame, one in ((3, counts), (9, None))
    ]
    return [_written(lambda path: write_counting_sheet(path, rows), "counts.csv")]


def _read_cached_arrays(path: Path) -> object:
    """Read an entry of the cache, which makes it again where it is damaged."""
    from data.array_store import ArrayStore

    return ArrayStore(path.parents[1]).get("entry", lambda: {"maps": _rows()})


def _read_checkpoint(path: Path) -> object:
    from train.checkpoints import read_checkpoint

    return read_checkpoint(path, "detector")


def _checkpoints() -> Sequence[bytes]:
    import torch

    file = io.BytesIO()
    content = {
        "hyper_parameters": {"model": "detector"},
        "state_dict": {"a": torch.ones(3)},
        "epoch": 3,
    }
    torch.save(content, file)
    return [file.getvalue()]


def _read_network(path: Path) -> object:
    from perception.detection.detectors.detector_network import open_network

    return open_network(path, threads=1)


def _networks() -> Sequence[bytes]:
    """Return one network of each form of outputs, with what exporters state in metadata."""
    from tests.detection.public_forms import FORMS, write_network

    names = {"names": str(dict(enumerate(COCO_CLASSES))), "kpt_shape": "[0, 3]", "task": "detect"}
    metadata = {form: names if form.startswith(("yolo", "ultralytics")) else {} for form in FORMS}

    def write(form: str) -> bytes:
        return _written(lambda path: write_network(path, form, metadata=metadata[form]), "0.onnx")

    return [write(form) for form in FORMS]


def _read_class_names(path: Path) -> object:
    from perception.detection.detectors.model_metadata import class_names, keypoint_columns

    text = path.read_bytes().decode(errors="replace")
    try:
        return class_names({"names": text}, path.name)
    except ModelError:
        return keypoint_columns({"kpt_shape": text}, path.name)


# --- Logs and bags --------------------------------------------------------------------------------


def _read_table(path: Path) -> object:
    from data.nuscenes.json_tables import read_records

    return read_records(path, ("token", "name"))


def _read_feather(path: Path) -> object:
    from data.argoverse2.tables import read_feather

    table = read_feather(path, ("x", "y", "name"), LabelError, "a table")
    return table.numbers("x", "y")


def _feathers() -> Sequence[bytes]:
    import pyarrow as pa
    from pyarrow import feather

    table = pa.table({"x": [1.0, 2.0], "y": [3.0, 4.0], "name": ["car", "van"]})
    contents = []
    for compression in ("uncompressed", "lz4", "zstd"):
        file = io.BytesIO()
        feather.write_feather(table, file, compression=compression)
        contents.append(file.getvalue())
    return contents


def _read_bag(path: Path) -> object:
    from data.bags.bag import Bag

    bag = Bag(path)
    return [bag.decode(message) for message in bag.messages(list(bag.kinds))]


def _bag(kind: str) -> Callable[[], Sequence[bytes]]:
    def seeds() -> Sequence[bytes]:
        from tests.bag_writer import FIRST_NS, KINDS, BagWriter

        with TemporaryDirectory() as folder:
            columns = {name: np.arange(3, dtype=np.float32) for name in ("x", "y", "z")}
            with BagWriter(Path(folder) / "bag", kind) as bag:
                bag.cloud("/points", FIRST_NS, columns)
            (file,) = Path(folder).rglob(f"*{Path(KINDS[kind]).suffix}")
            return [file.read_bytes()]

    return seeds


_STAMPS = ("1317036272.123456\n1317036272.223456\n1317036272.323456\n",)
_DATES = "2011-09-26 13:04:32.335337762\n2011-09-26 13:04:32.435337762\n2011-09-26 13:04:32.5\n"
_TUM = "".join(f"{1317036272 + n / 10} {n} 0 0 0 0 0 1\n" for n in range(_FRAMES))
_KITTI = "".join(f"1 0 0 {n} 0 1 0 0 0 0 1 0\n" for n in range(_FRAMES))
_FRAME_POSES = "".join(f"{2 * n} 1 0 0 {n} 0 1 0 0 0 0 1 0\n" for n in range(_FRAMES))
_CSV = "t,x,y,z,qx,qy,qz,qw\n" + _TUM.replace(" ", ",")
_INS = "t,latitude,longitude,altitude,roll,pitch,yaw\n" + "".join(
    f"{1317036272 + n / 10},49.0{n},8.4,110,0,0,{n}\n" for n in range(_FRAMES)
)
_SENSOR = "name: mine\nelevations_deg: [-15, -5, 5, 15]\nazimuth_step_deg: 0.2\nheight_m: 1.8\n"


def _read_recording(path: Path) -> object:
    from data.packets.recording import open_recording

    recording = open_recording(path)
    return recording.stamps_ns, recording.cloud(len(recording.sweeps) - 1), recording.sensor


def _recordings(form: str) -> Callable[[], Sequence[bytes]]:
    def written() -> Sequence[bytes]:
        from tests import packet_writer as made

        room = [one for data in made.turns(0.3)[::3] for one in made.udp(data, mtu=1000)]
        write = getattr(made, form)
        links = ("ethernet", "two tags", "linux cooked 2")
        return [
            _written(lambda path, link=link: write(room, path, link=link), "a") for link in links
        ]

    return written


PARSERS: dict[str, FileParser] = {
    "scan": FileParser("000000.bin", _read_scan, _scans),
    "image": FileParser("000000.png", _read_image, _images),
    "point-labels": FileParser(
        "000000.label", _read_point_labels, lambda: [np.arange(_POINTS, dtype=np.uint32).tobytes()]
    ),
    "calibration": FileParser("0000.txt", _read_calibration, _calibrations),
    "raw-calibration": FileParser(
        "calib_velo_to_cam.txt",
        _read_raw_calibration,
        _texts(_VELO_TO_CAM),
        {
            "calib_cam_to_cam.txt": _CAMERAS.encode,
            "calib_imu_to_velo.txt": _RIGID.encode,
        },
    ),
    "ins-packet": FileParser("0000000000.txt", _read_packet, _packets),
    "object-labels": FileParser(
        "000000.txt", _read_object_labels, _texts(f"{_OBJECT}\n{_DONT_CARE}\n", "")
    ),
    "tracking-labels": FileParser(
        "0000.txt", _read_tracking_labels, _texts(f"0 7 {_OBJECT}\n1 7 {_OBJECT}\n1 -1 {_DONT_CARE}\n")
    ),
    "label-rows": FileParser("0000.txt", _read_label_rows, _texts(f"0 7 {_OBJECT}\n2 -1 {_DONT_CARE}")),
    "result-rows": FileParser(
        "0000.txt", _read_result_rows, _texts(f"0 7 {_OBJECT} 0.9\n", "1,7,30,12,25,18,0.9,-1,-1,-1\n")
    ),
    "json-results": FileParser(
        "found.json", _read_json_results, _texts(*map(json.dumps, ([_COCO], *_SCENE_RESULTS)))
    ),
    "coco-categories": FileParser(
        "instances.json", _read_categories, _texts(json.dumps(_CATEGORIES), json.dumps({**_CATEGORIES, "images": _IMAGES}))
    ),
    "sequence-map": FileParser(
        "evaluate_tracking.seqmap", _read_seqmap, _texts("0000 empty 000000 000154\n")
    ),
    "frame-list": FileParser("val.txt", _read_frame_list, _texts("000001\n000007\n")),
    "timestamps": FileParser("timestamps.txt", _read_timestamps, _texts(_DATES)),
    "kitti360-velo": FileParser(
        "calib_cam_to_velo.txt",
        _read_rig,
        _texts(_CAM_TO_VELO),
        {"calib_cam_to_pose.txt": _CAM_TO_POSE.encode, "perspective.txt": _PERSPECTIVE.encode},
    ),
    "kitti360-camera": FileParser(
        "perspective.txt", _read_rig, _texts(_PERSPECTIVE), {"calib_cam_to_velo.txt": _CAM_TO_VELO.encode}
    ),
    "kitti360-rig": FileParser(
        "calib_cam_to_pose.txt", _read_rig, _texts(_CAM_TO_POSE), {"calib_cam_to_velo.txt": _CAM_TO_VELO.encode}
    ),
    "kitti360-poses": FileParser("poses.txt", _read_stated_poses, _texts(_FRAME_POSES)),
    "kitti360-boxes": FileParser("drive.xml", _read_boxes, _stored_boxes),
    "pcd": FileParser("0.pcd", _read_cloud, _pcds),
    "ply": FileParser("0.ply", _read_cloud, _plys),
    "npy": FileParser("0.npy", _read_cloud, _npys),
    "npz": FileParser("0.npz", _read_cloud, _npzs),
    "csv": FileParser("0.csv", _read_cloud, _texts("x,y,z,intensity\n1,2,3,0.5\n4,5,6,0.25\n", "1 2 3\n4 5 6\n")),
    "drive-file": FileParser("drive.yaml", _read_drive_file, _texts(_DRIVE_FILE)),
    "poses-kitti": FileParser("poses.txt", _pose_reader("kitti"), _texts(_KITTI)),
    "poses-tum": FileParser("poses.txt", _pose_reader("tum"), _texts(_TUM)),
    "poses-csv": FileParser("poses.csv", _pose_reader("csv"), _texts(_CSV)),
    "poses-ins": FileParser("ins.csv", _pose_reader("ins"), _texts(_INS)),
    "stamps": FileParser("times.txt", _read_stamps, _texts(*_STAMPS, _DATES)),
    "sensor": FileParser("sensor.yaml", _read_sensor, _texts(_SENSOR, "model: VLP-16\nheight_m: 2\n")),
    "split": FileParser("split.json", _read_split, _texts(json.dumps(_SPLIT))),
    "flags": FileParser("config.yaml", _read_flags, _texts("sequence: 0000\npipeline:\n  motion: {voxel_size: 1e-1}\n")),
    "frame-lines": FileParser("frames.jsonl", _read_frame_lines, _frame_lines),
    "counting-sheet": FileParser("counts.csv", _read_counting_sheet, _counting_sheets),
    "cached-arrays": FileParser("entry/maps.npy", _read_cached_arrays, _npys),
    "checkpoint": FileParser("best.ckpt", _read_checkpoint, _checkpoints),
    "network": FileParser("detector.onnx", _read_network, _networks),
    "class-names": FileParser(
        "names.txt", _read_class_names, _texts("{0: 'car', 1: 'van'}", '["car", "van"]', "[17, 3]")
    ),
    "nuscenes-table": FileParser(
        "scene.json", _read_table, _texts(json.dumps([{"token": "a", "name": "scene-0001"}]))
    ),
    "feather": FileParser("annotations.feather", _read_feather, _feathers),
    "mcap": FileParser("drive.mcap", _read_bag, _bag("mcap")),
    "db3": FileParser("drive.db3", _read_bag, _bag("db3")),
    "ros1-bag": FileParser("drive.bag", _read_bag, _bag("ros1")),
    "pcap": FileParser("drive.pcap", _read_recording, _recordings("pcap")),
    "pcapng": FileParser("drive.pcapng", _read_recording, _recordings("pcapng")),
}  # fmt: skip

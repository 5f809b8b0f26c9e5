"""`trifuse study`: the studies of the thesis and of its claims; their code is in benchmarks/studies."""

from collections.abc import Mapping

# One line of help by name. Only the source tree holds their code.
STUDIES: Mapping[str, str] = {
    "ground-error": "ground error over merged scans and slice width (Fig. 7.1)",
    "speed": "frames per second over merged scans and voxel size (Fig. 7.3)",
    "stages": "share of the time of each stage (Table 7.3)",
    "dense-cloud": "a pole in the merged cloud, before and after registration (Fig. 5.2)",
    "gates": "gates and planes of the ground, from the side (Figs 5.4, 5.5)",
    "masks": "counters and masks of the static-moving segmentation (Fig. 5.6)",
    "motion-grid": "2.5D motion grids and the objects in them (Fig. 5.10)",
    "datmo-film": "film of the 2.5D motion grids on a highway, at a junction and at a crossing (Fig. 7.6)",
    "ins-error": "tracks of moving objects over the error of the INS (7.1.1)",
    "sensors": "tracks of moving objects by LiDAR",
    "uncertainty": "share of exact truth within the 90 % intervals of poses, moving objects and boxes, by LiDAR",
    "false-movers": "false movers at fences, hedges and rows of trees over speed and distance",
    "jams": "long vehicles in traffic jams, with and without INS: moving points, ids and poses",
    "fault-detection": "delay and recall of faults of sensors that are named, and false alarms",
    "growth": "processor time of a frame over beams, points, area and length of the drive",
    "single-object": "challenges of tracking one object, on scenes with exact truth",
    "tracker-parameters": "gate of 3D-KF and iterations of 3D-MS (App. A.1)",
    "tracking-results": "tracked objects in the image and in 3D over time (Figs 7.7, 7.8)",
    "fleet": "many drives by workers that share them: throughput, cost of the engine, deaths of processes",
    "thesis": "all of 7.2, trained and measured (Tables 7.8 to 7.10, Figs 7.8 to 7.16)",
    "augmentation": "DepthCN trained without and with augmentation (Table 7.8)",
    "reflectance-maps": "detectors of sparse, interpolated and wide reflectance maps (Tables B.1 to B.3)",
    "detector-losses": "a detector trained with each form of the loss",
    "calibration": "errors of the calibration of LiDAR and camera, found again and noticed",
    "sim-to-real": "a detector trained on more and more synthetic frames",
}


def target(name: str) -> str:
    """Return where the function of a study is, as `module:function`."""
    module = name.replace("-", "_")
    return f"benchmarks.studies.{module}:{module}"

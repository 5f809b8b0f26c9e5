"""`trifuse study`: the studies of the thesis and of its claims; their code is in benchmarks/studies."""

from collections.abc import Mapping

# name: function, and one line of help. Only the source tree holds them.
STUDIES: Mapping[str, tuple[str, str]] = {
    "ground-error": (
        "benchmarks.studies.ground_error:ground_error",
        "ground error over merged scans and slice width (Fig. 7.1)",
    ),
    "speed": (
        "benchmarks.studies.speed:speed",
        "frames per second over merged scans and voxel size (Fig. 7.3)",
    ),
    "stages": ("benchmarks.studies.stages:stages", "share of the time of each stage (Table 7.3)"),
    "dense-cloud": (
        "benchmarks.studies.dense_cloud:dense_cloud",
        "a pole in the merged cloud, before and after registration (Fig. 5.2)",
    ),
    "gates": (
        "benchmarks.studies.gates:gates",
        "gates and planes of the ground, from the side (Figs 5.4, 5.5)",
    ),
    "masks": (
        "benchmarks.studies.masks:masks",
        "counters and masks of the static-moving segmentation (Fig. 5.6)",
    ),
    "motion-grid": (
        "benchmarks.studies.motion_grid:motion_grid",
        "2.5D motion grids and the objects in them (Fig. 5.10)",
    ),
    "datmo-film": (
        "benchmarks.studies.datmo_film:datmo_film",
        "film of the 2.5D motion grids on a highway, at a junction and at a crossing (Fig. 7.6)",
    ),
    "ins-error": (
        "benchmarks.studies.ins_error:ins_error",
        "tracks of moving objects over the error of the INS (7.1.1)",
    ),
    "sensors": ("benchmarks.studies.sensors:sensors", "tracks of moving objects by LiDAR"),
    "single-object": (
        "benchmarks.studies.single_object:single_object",
        "challenges of tracking one object, on scenes with exact truth",
    ),
    "tracker-parameters": (
        "benchmarks.studies.tracker_parameters:tracker_parameters",
        "gate of 3D-KF and iterations of 3D-MS (App. A.1)",
    ),
    "tracking-results": (
        "benchmarks.studies.tracking_results:tracking_results",
        "tracked objects in the image and in 3D over time (Figs 7.7, 7.8)",
    ),
    "thesis": (
        "benchmarks.studies.thesis:thesis",
        "all of 7.2, trained and measured (Tables 7.8 to 7.10, Figs 7.8 to 7.16)",
    ),
    "augmentation": (
        "benchmarks.studies.augmentation:augmentation",
        "DepthCN trained without and with augmentation (Table 7.8)",
    ),
    "reflectance-maps": (
        "benchmarks.studies.reflectance_maps:reflectance_maps",
        "detectors of sparse, interpolated and wide reflectance maps (Tables B.1 to B.3)",
    ),
    "detector-losses": (
        "benchmarks.studies.detector_losses:detector_losses",
        "a detector trained with each form of the loss",
    ),
    "sim-to-real": (
        "benchmarks.studies.sim_to_real:sim_to_real",
        "a detector trained on more and more synthetic frames",
    ),
}

"""`trifuse adopt`."""

import sys
from pathlib import Path
from typing import Literal


def adopt(
    folder: Path,
    *,
    overwrite: bool = False,
    columns: tuple[str, ...] = (),
    sensor: str | None = None,
    lidar: str | None = None,
    height: float | None = None,
    axes: tuple[str, ...] = (),
    rate: float | None = None,
    reflectance_scale: float | None = None,
    viewpoint: Literal["ignored", "applied", "undone"] | None = None,
    intrinsics: tuple[float, ...] = (),
    distortion: tuple[float, ...] = (),
    fisheye: bool = False,
    lidar_to_camera: tuple[float, ...] = (),
    body_to_lidar: tuple[float, ...] = (),
) -> None:
    """Inspect a folder of scans of any format, or recorded packets, print the findings and write its drive.yaml.

    What cannot be determined is asked on a terminal, or written as a question into drive.yaml.
    With several cameras, give the numbers of one camera after another, in the order in which they are printed.

    Example: trifuse adopt my_drive --intrinsics 721.5,721.5,609.6,172.9 --lidar-to-camera 0,-0.08,-0.27,90,-90,0

    Args:
        folder: Folder with scans as .bin, .npy, .npz, .pcd, .ply or .csv, and images, poses or times beside them; or a .pcap file.
        overwrite: Replace the drive.yaml that is there.
        columns: Names of the columns in order, where the files have none: x,y,z,intensity,ring,t; _ for others.
        sensor: LiDAR model by name, or a file that describes one; of recorded packets the metadata.
        lidar: Address and port of the LiDAR, where packets of several were recorded.
        height: Height of the LiDAR above the road in metres.
        axes: Directions in which x, y and z of the files point, such as right,forward,up.
        rate: Scans per second.
        reflectance_scale: Value in the files of a reflectance of 1, such as 255.
        viewpoint: VIEWPOINT of PCD files: ignored, applied to the points, or undone where they are in the world's frame.
        intrinsics: Focal lengths and principal point of the camera in pixels, fx,fy,cx,cy.
        distortion: Distortion coefficients of the camera as OpenCV has them; none for rectified images.
        fisheye: The coefficients are those of OpenCV's fisheye model.
        lidar_to_camera: Transform of points to the camera (x right, y down, z forward): 12 numbers of a matrix,
            x,y,z,qx,qy,qz,qw, or x,y,z,roll,pitch,yaw in degrees.
        body_to_lidar: Transform from the body of the poses (IMU, camera) to the LiDAR in the same forms; none where
            poses are of the LiDAR.
    """
    from data.folder import adoption
    from data.folder.description import observation_table
    from data.folder.stated_cameras import split_cameras
    from data.layouts import OpenConfig

    if (layout := adoption.other_layout_of(folder)) is not None:
        print(f"{folder}: {layout}, which needs no drive.yaml")
        return
    folder, observed = adoption.observe(
        folder, OpenConfig(sensor=sensor, lidar=lidar, columns=columns)
    )
    cameras = split_cameras(intrinsics, distortion, lidar_to_camera, is_fisheye=fisheye)
    stated = adoption.StatedConfig(
        sensor, height, axes, rate, reflectance_scale, viewpoint, cameras, body_to_lidar
    )
    print(observation_table(observed.observations))
    if sys.stdin.isatty():
        stated = adoption.ask(adoption.open_questions(observed, stated), stated, input)
    path, left = adoption.write_description(folder, observed, stated, overwrite=overwrite)
    print(f"\nwrote {path}")
    if left:
        print(f"could not be seen, and is a question in that file: {', '.join(map(str, left))}")
    print(f"next: trifuse check {folder}")

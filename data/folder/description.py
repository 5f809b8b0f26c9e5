"""drive.yaml as text: what is known as values with their reasons, what is not as questions in comments."""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from data.folder.config import FolderConfig, LidarConfig
from data.folder.observation import FolderObservation, Observation
from data.folder.stated_cameras import camera_names

_CAMERA_TEMPLATE = """\
{name}:
  images: {images}
  fx_px: 700.0            # focal lengths and principal point in pixels
  fy_px: 700.0
  cx_px: 640.0
  cy_px: 360.0
  model: pinhole          # or fisheye
  distortion: []          # k1 k2 p1 p2 k3 of OpenCV's pinhole, k1 k2 k3 k4 of its fisheye; none of rectified images
  lidar_to_camera:        # from the LiDAR, axes as in the files, to the camera with x right, y down, z forward
    translation_m: [0.0, 0.0, 0.0]
    quaternion_xyzw: [0.0, 0.0, 0.0, 1.0]    # or roll_pitch_yaw_deg: [...], or a matrix: [[...], ...]
"""


def description_text(
    config: FolderConfig, observed: FolderObservation, questions: Mapping[str, str]
) -> str:
    """Return the text of drive.yaml.

    Args:
        config: What is known.
        observed: What was seen, with its reasons.
        questions: Question on each field that is not known.
    """
    seen = observed.config.lidar
    is_seen = {
        one.name: getattr(config.lidar, one.name) == getattr(seen, one.name)
        for one in dataclasses.fields(seen)
    }
    # What is stated needs no reason.
    reasons = {one.field: one for one in observed.observations if is_seen.get(one.field, True)}
    lines = [
        "# What trifuse has to know of this drive; paths are relative to this folder.",
        "lidar:",
    ]
    lines += _section(
        config.lidar, LidarConfig(), reasons, {"axes", "height_m", "reflectance_scale"}
    )
    lines += [f"  # {name}:    # {text}" for name, text in questions.items() if name != "camera"]
    lines += _camera_lines(config, observed, questions.get("camera", ""), reasons)
    if config.poses is not None:
        lines += ["poses:", *_section(config.poses, None, reasons, set())]
        if config.poses.body_to_lidar is None:
            lines += [
                "  # body_to_lidar:    # where poses are of the IMU or the camera, and not of the LiDAR"
            ]
    if config.labels is not None:
        lines.append(f"labels: {_inline(config.labels)}")
    return "\n".join(lines) + "\n"


def _camera_lines(
    config: FolderConfig,
    observed: FolderObservation,
    question: str,
    reasons: Mapping[str, Observation],
) -> Iterator[str]:
    """Yield the cameras that are known, and as comments to be filled in those that are not."""
    names = camera_names(observed.images)
    if len(names) < 2:
        if config.camera is not None:
            yield from ("camera:", *_section(config.camera, None, reasons, set()))
        elif names:
            yield f"# {question}"
            yield from (f"# {line}" for line in _template("camera", observed.images[0]))
        return
    if len(config.cameras) < len(names):
        yield f"# {question}"
    yield "cameras:" if config.cameras else "# cameras:"
    for name, images in zip(names, observed.images, strict=True):
        if name in config.cameras:
            yield f"  {_inline(name)}:"
            yield from (f"  {line}" for line in _section(config.cameras[name], None, {}, set()))
        else:
            yield from (f"#   {line}" for line in _template(_inline(name), images))


def _template(name: str, images: str) -> list[str]:
    return _CAMERA_TEMPLATE.format(name=name, images=_inline(images)).splitlines()


def _section(
    section: Any,  # noqa: ANN401 - any dataclass
    default: Any,  # noqa: ANN401 - of the same kind
    reasons: Mapping[str, Observation],
    always: set[str],
) -> Iterator[str]:
    """Yield the fields that differ from their defaults, with the reasons for their values."""
    for one in dataclasses.fields(section):
        value = getattr(section, one.name)
        usual = getattr(default, one.name) if default is not None else one.default
        if value is None or (value == usual and one.name not in always):
            continue
        reason = reasons.get(one.name)
        if dataclasses.is_dataclass(value):
            yield f"  {one.name}:"
            yield from (f"  {line}" for line in _section(value, None, {}, set()))
            continue
        line = f"  {one.name}: {_inline(value)}"
        yield f"{line:<32}  # {reason.certainty}: {reason.reason}" if reason is not None else line


def _inline(value: object) -> str:
    import yaml

    listed = _listed(value)
    text: str = yaml.safe_dump(listed, default_flow_style=True, width=10_000, sort_keys=False)
    return text.removesuffix("\n").removesuffix("\n...")


def _listed(value: object) -> object:
    return [_listed(one) for one in value] if isinstance(value, (tuple, list)) else value


def observation_table(observations: Sequence[Observation]) -> str:
    """Return a table of what was seen, and how sure it is."""
    rows = [("property", "value", "certainty", "seen in")]
    rows += [(one.what, one.value, one.certainty, one.reason) for one in observations]
    widths = [max(len(row[column]) for row in rows) for column in range(3)]
    return "\n".join(
        "  ".join(f"{cell:{width}}" for cell, width in zip(row, [*widths, 0], strict=True)).rstrip()
        for row in rows
    )

"""Dense maps by every method on the same scans: time, and errors at held-out returns."""

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from cv2.typing import MatLike

from benchmarks.measure import Comparison, Contender, Measurement, compare
from benchmarks.stages import PreparedDrive
from perception.evaluation.report import Column
from perception.maps.densify import FILL_METHODS, Fill, dense_maps
from perception.maps.encoding import encode_depth, encode_reflectance
from perception.maps.filling import FilledMaps
from perception.maps.projection import SparseMaps, project_frame
from perception.types import ArrayTable, Bool, Float32, Float64, UInt8

_FAR_M = 100.0
_LEFT_OUT = 0.1
_RELATIVE, _ABSOLUTE_M = 0.05, 0.5


def fill_by_morphology(sparse: SparseMaps) -> FilledMaps:
    """Fill the depth map by dilation of inverted depths, small kernels first, as IP-Basic describes.

    From the paper (Ku, Harakeh, Waslander; 2018): dilate with a diamond, close small holes, fill
    middle ones, extend columns upwards, fill large ones, blur. It knows depth alone, so that
    reflectances are dilated with kernels of the same sizes: the brightest wins there.
    """
    if not len(sparse):
        return FilledMaps.empty(sparse.size_px)
    inverted = _dilated(sparse.scattered(np.asarray(_FAR_M - sparse.depth_m, np.float32)))
    # Reflectances of 0 are measured: lifted, so that they differ from none.
    lifted = _dilated(sparse.scattered(sparse.reflectance + np.float32(1)))
    is_known = inverted > 0
    depth_m = np.where(is_known, _FAR_M - inverted, 0).astype(np.float32)
    return FilledMaps(depth_m, np.clip(lifted - 1, 0, 1)).with_measured(sparse)


def fill_nearest_by_chamfer(sparse: SparseMaps) -> FilledMaps:
    """Let OpenCV's distance transform name the nearest return, in its 5 x 5 approximation."""
    if not len(sparse):
        return FilledMaps.empty(sparse.size_px)
    _, labels = cv2.distanceTransformWithLabels(
        (~sparse.is_measured).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    number = np.zeros(len(sparse) + 1, np.int32)
    number[labels[sparse.pixels[:, 1], sparse.pixels[:, 0]]] = np.arange(len(sparse))
    nearest = number[labels]
    return FilledMaps(sparse.depth_m[nearest], sparse.reflectance[nearest])


def _dilated(values: Float32) -> Float32:
    from_center = np.abs(np.arange(-2, 3))
    diamond = (from_center + from_center[:, None] <= 2).astype(np.uint8)
    dense = cv2.dilate(values, diamond)
    dense = cv2.morphologyEx(dense, cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
    dense = _with_holes_dilated(dense, 7)
    top = np.argmax(dense > 0, axis=0)
    rows = np.arange(dense.shape[0])[:, None]
    dense = np.where(rows < top, dense[top, np.arange(dense.shape[1])], dense)
    dense = _with_holes_dilated(dense, 31)
    dense = cv2.medianBlur(np.ascontiguousarray(dense, np.float32), 5)
    return np.where(dense > 0, cv2.GaussianBlur(dense, (5, 5), 0), dense).astype(np.float32)


def _with_holes_dilated(dense: MatLike, edge_px: int) -> MatLike:
    return np.where(dense > 0, dense, cv2.dilate(dense, np.ones((edge_px, edge_px), np.uint8)))


_CONTENDERS: Mapping[str, Fill] = {
    "Trifuse": FILL_METHODS["default"],
    "thesis: Delaunay, nearest vertex (SciPy)": FILL_METHODS["thesis"],
    "nearest return": FILL_METHODS["nearest"],
    "linear in triangles (SciPy)": FILL_METHODS["linear"],
    "nearest return, OpenCV's chamfer": fill_nearest_by_chamfer,
    "morphology, as IP-Basic": fill_by_morphology,
}


@dataclass(frozen=True)
class HeldOutErrors(ArrayTable):
    """Errors at K returns that a method was not shown.

    Attributes:
        depth_m: (K,) absolute errors of the depth in metres.
        is_close: (K,) whether the depth is within 5 % or 0.5 m.
        reflectance: (K,) absolute errors of the reflectance.
    """

    depth_m: Float64
    is_close: Bool
    reflectance: Float64


def compare_maps(prepared: PreparedDrive) -> Comparison:
    """Project, fill and encode both maps of every frame; measure each method at a held-out tenth of the returns."""
    sparse = [project_frame(frame) for frame in prepared.frames]

    def contender(name: str, fill: Fill) -> Contender:
        def run(i: int) -> tuple[UInt8, UInt8]:
            dense = dense_maps(project_frame(prepared.frames[i]), fill)
            return encode_depth(dense.depth_m), encode_reflectance(dense.reflectance)

        return Contender(name, run)

    errors = held_out_errors(sparse, np.random.default_rng(0))
    columns = (
        Column[Measurement]("MAE [m]", lambda m: errors[m.name].depth_m.mean(), ".3f", "mae_m"),
        Column[Measurement](
            "within 5 % [%]", lambda m: 100 * errors[m.name].is_close.mean(), ".2f", "close_percent"
        ),
        Column[Measurement](
            "reflectance MAE", lambda m: errors[m.name].reflectance.mean(), ".4f", "reflectance_mae"
        ),
    )
    contenders = [contender(*item) for item in _CONTENDERS.items()]
    return compare("depth and reflectance map", contenders, len(sparse), *columns)


def held_out_errors(
    scans: list[SparseMaps], generator: np.random.Generator
) -> dict[str, HeldOutErrors]:
    """Hold out a tenth of the returns of each scan; compare where all methods give a value."""
    parts: dict[str, list[HeldOutErrors]] = {name: [] for name in _CONTENDERS}
    for sparse in scans:
        is_out = generator.random(len(sparse)) < _LEFT_OUT
        shown, out = sparse[~is_out], sparse[is_out]
        column, row = out.pixels.T
        fillings = {name: fill(shown) for name, fill in _CONTENDERS.items()}
        known = np.all([f.depth_m[row, column] > 0 for f in fillings.values()], axis=0)
        for name, filling in fillings.items():
            parts[name].append(_errors(filling, out[known]))
    return {name: HeldOutErrors.concatenate(of_scans) for name, of_scans in parts.items()}


def _errors(filling: FilledMaps, out: SparseMaps) -> HeldOutErrors:
    column, row = out.pixels.T
    depth_m = np.abs(filling.depth_m[row, column] - out.depth_m).astype(np.float64)
    return HeldOutErrors(
        depth_m=depth_m,
        is_close=np.asarray((depth_m < _RELATIVE * out.depth_m) | (depth_m < _ABSOLUTE_M)),
        reflectance=np.abs(filling.reflectance[row, column] - out.reflectance).astype(np.float64),
    )

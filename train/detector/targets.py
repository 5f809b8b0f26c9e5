"""Assignment of labels to predictions: the responsible cell and anchor of each label, and its targets.

The cell of the label's centre is responsible, with the anchor of the most similar shape. Where two labels of one
cell match the same anchor, the better match gets it, and the other gets its next best free anchor: with cells of
32 pixels, parked cars would not be trained on otherwise.
"""

from typing import NamedTuple

import torch
from torch import Tensor


class BatchLabels(NamedTuple):
    """Targets of B images, padded to L each with boxes of zero size, which are never assigned.

    Attributes:
        boxes_px: (B, L, 4) x1 y1 x2 y2 in pixels of the network's input.
        classes: (B, L) indices into the class names.
        is_ignored: (B, L) mask of the ignored areas.
    """

    boxes_px: Tensor
    classes: Tensor
    is_ignored: Tensor


class PredictionGrid(NamedTuple):
    """Cells over the input.

    Attributes:
        rows: Number of rows of cells.
        columns: Number of columns of cells.
        stride_px: Width and height of a cell in pixels.
    """

    rows: int
    columns: int
    stride_px: int


class GridTargets(NamedTuple):
    """N predictions that answer for a label.

    Attributes:
        image: (N,) number of the image in the batch.
        anchor: (N,) anchor.
        row: (N,) row of the cell.
        column: (N,) column of the cell.
        boxes_px: (N, 4) x1 y1 x2 y2 of the label.
        offsets: (N, 4) centre within the cell 0..1, and logarithms of width and height over the anchor's.
        classes: (N,) class index.
        area_shares: (N,) area of the label's box as a fraction of the image.
        unassigned: Number of labels outside the image, of no size, or in a cell whose anchors are all taken.
    """

    image: Tensor
    anchor: Tensor
    row: Tensor
    column: Tensor
    boxes_px: Tensor
    offsets: Tensor
    classes: Tensor
    area_shares: Tensor
    unassigned: int


def has_area(boxes_px: Tensor) -> Tensor:
    """Return (...) whether boxes (..., 4) are finite and of some size."""
    sizes = boxes_px[..., 2:] - boxes_px[..., :2]
    return boxes_px.isfinite().all(dim=-1) & (sizes > 0).all(dim=-1)


def assign_targets(labels: BatchLabels, anchors_px: Tensor, grid: PredictionGrid) -> GridTargets:
    """Return what answers for the labels of a batch.

    Args:
        labels: Labels of B images.
        anchors_px: (A, 2) widths and heights of the anchors.
        grid: Grid of the predictions.
    """
    centers = (labels.boxes_px[..., :2] + labels.boxes_px[..., 2:]) / 2
    extent_px = centers.new_tensor([grid.columns, grid.rows]) * grid.stride_px
    is_target = has_area(labels.boxes_px) & ~labels.is_ignored
    is_inside = ((centers >= 0) & (centers < extent_px)).all(dim=-1)
    image, label = (is_target & is_inside).nonzero(as_tuple=True)

    boxes_px, in_cells = labels.boxes_px[image, label], centers[image, label] / grid.stride_px
    column, row = in_cells.long().unbind(dim=1)
    sizes_px = boxes_px[:, 2:] - boxes_px[:, :2]
    cell = (image * grid.rows + row) * grid.columns + column
    anchor = _assign_anchors(shape_iou(sizes_px, anchors_px), cell)

    kept = anchor >= 0
    scales = sizes_px[kept] / anchors_px[anchor[kept]]
    is_labelled = (labels.boxes_px != 0).any(dim=-1)  # padding is all zero
    return GridTargets(
        image=image[kept],
        anchor=anchor[kept],
        row=row[kept],
        column=column[kept],
        boxes_px=boxes_px[kept],
        offsets=torch.cat([in_cells[kept].frac(), scales.log()], dim=1),
        classes=labels.classes[image, label][kept],
        area_shares=sizes_px[kept].prod(dim=1) / extent_px.prod(),
        unassigned=int((is_labelled & ~labels.is_ignored).sum()) - int(kept.sum()),
    )


def shape_iou(a_px: Tensor, b_px: Tensor) -> Tensor:
    """Return (A, B) overlaps of sizes (A, 2) and (B, 2) laid on one corner."""
    common = torch.minimum(a_px[:, None], b_px).prod(dim=-1)
    return common / (a_px.prod(dim=-1)[:, None] + b_px.prod(dim=-1) - common)


def _assign_anchors(overlaps: Tensor, cell: Tensor) -> Tensor:
    """Return (N,) the anchor of each label, -1 where its cell had none left.

    Every round serves at least one label of each cell, hence as many rounds as anchors.

    Args:
        overlaps: (N, A) IoU of the labels' shapes with the anchors.
        cell: (N,) number of the cell of each label.
    """
    _, cell = torch.unique(cell, return_inverse=True)
    count, anchors = overlaps.shape
    anchor = cell.new_full((count,), -1)
    is_taken = torch.zeros(count, anchors, dtype=torch.bool, device=cell.device)
    for _ in range(anchors):
        waiting = (anchor < 0).nonzero()[:, 0]
        wish, choice = overlaps[waiting].masked_fill(is_taken[cell[waiting]], -1).max(dim=1)
        best = _best_of_each(cell[waiting] * anchors + choice, wish)
        best = best[wish[best] >= 0]
        anchor[waiting[best]] = choice[best]
        is_taken[cell[waiting[best]], choice[best]] = True
    return anchor


def _best_of_each(group: Tensor, value: Tensor) -> Tensor:
    """Return the index of the largest value of every group, the first of equal ones."""
    order = value.argsort(descending=True, stable=True)
    order = order[group[order].argsort(stable=True)]
    ordered = group[order]
    is_first = torch.ones_like(ordered, dtype=torch.bool)
    is_first[1:] = ordered[1:] != ordered[:-1]
    return order[is_first]

from dataclasses import dataclass
from types import GenericAlias
from typing import Annotated, Any

import numpy as np
import pytest
from numpy.typing import NDArray

from perception.errors import PerceptionError
from perception.types import (
    SHARED,
    ArrayTable,
    Boxes3D,
    Detections,
    Float64,
    FusedDetections,
    Int,
    Tracks,
)


@dataclass(frozen=True)
class Places(ArrayTable):
    xy_m: Annotated[Float64, 2]
    numbers: Int
    boxes: Boxes3D
    features: Annotated[Float64, ...]
    name: Annotated[str, SHARED] = "here"


def places(*numbers: int) -> Places:
    n = np.array(numbers, np.int64)
    boxes = Boxes3D(np.ones((len(n), 3)) * n[:, None], np.ones((len(n), 3)), np.zeros(len(n)))
    return Places(np.stack([n, -n], axis=1) * 1.0, n, boxes, np.zeros((len(n), 2, 5)), "there")


@pytest.mark.parametrize(
    "rows",
    [np.array([True, False, True]), np.array([0, 2]), slice(0, 3, 2)],
    ids=["mask", "indices", "slice"],
)
def test_rows_are_taken_from_every_column_and_shared_fields_stay(rows):
    chosen = places(5, 6, 7)[rows]
    assert chosen.numbers.tolist() == [5, 7]
    assert chosen.xy_m.tolist() == [[5, -5], [7, -7]]
    assert chosen.boxes.bottom_m[:, 0].tolist() == [5, 7]
    assert chosen.features.shape == (2, 2, 5)
    assert chosen.name == "there"


def test_parts_are_concatenated_in_order():
    whole = Places.concatenate([places(1), places(), places(3, 2)])
    assert whole.numbers.tolist() == [1, 3, 2]
    assert whole.boxes.bottom_m[:, 2].tolist() == [1, 3, 2]
    assert whole.name == "there"
    assert places(1).joined(places(9)).numbers.tolist() == [1, 9]


def test_no_parts_and_an_empty_table_have_the_shapes_and_types_of_their_columns():
    for none in (Places.concatenate([]), Places.empty()):
        assert len(none) == 0
        assert (none.xy_m.shape, none.boxes.size_m.shape) == ((0, 2), (0, 3))
        assert (none.numbers.dtype, none.xy_m.dtype) == (np.int64, np.float64)
    fused = FusedDetections.empty()
    assert fused.source_indices.shape == (0, 3)
    assert fused.detections.types.dtype.kind == "U"
    assert Tracks.empty().is_observed.dtype == bool


@pytest.mark.parametrize("scalar", [np.bool_, np.int64, np.float32, np.str_])
def test_the_type_of_a_column_is_read_from_its_annotation(scalar):
    """`NDArray[T]` stands for an array of `dtype[T]`, from NumPy 2.5 on by a name that holds T alone."""
    of_a_name = GenericAlias(list, (scalar,))
    for annotation in (np.ndarray[Any, np.dtype[scalar]], of_a_name, NDArray[scalar]):
        kind = dataclass(frozen=True)(
            type("One", (ArrayTable,), {"__annotations__": {"values": annotation}})
        )
        assert kind.empty().values.dtype.type is scalar


def test_rows_are_replaced():
    changed = places(1, 2, 3).replaced(np.array([2, 0]), places(30, 10))
    assert changed.numbers.tolist() == [10, 2, 30]
    assert changed.boxes.bottom_m[:, 0].tolist() == [10, 2, 30]
    masked = places(1, 2, 3).replaced(np.array([True, False, True]), places(10, 30))
    assert masked.numbers.tolist() == [10, 2, 30]
    assert (masked.name, len(masked.replaced(np.zeros(0, np.int64), places()))) == ("there", 3)


def test_a_replaced_row_may_have_a_longer_name_and_leaves_the_table_as_it_was():
    cars = Detections(np.zeros((2, 4)), np.zeros(2), np.array(["Car", "Van"]))
    cyclist = Detections(np.ones((1, 4)), np.ones(1), np.array(["Cyclist"]))
    changed = cars.replaced(np.array([1]), cyclist)
    assert changed.types.tolist() == ["Car", "Cyclist"]
    assert changed.scores.tolist() == [0, 1]
    assert (cars.types.tolist(), cars.scores.tolist()) == (["Car", "Van"], [0, 0])


def test_shared_fields_without_a_default_are_given():
    @dataclass(frozen=True)
    class Pixels(ArrayTable):
        depths_m: Float64
        size_px: Annotated[tuple[int, int], SHARED]

    assert Pixels.empty(size_px=(4, 3)).size_px == (4, 3)


@pytest.mark.parametrize(
    ("columns", "where", "expected", "found"),
    [
        ((np.zeros((2, 4)), np.zeros(3)), "scores", "shape (2,)", "shape (3,)"),
        ((np.zeros((2, 4)), np.zeros((2, 1))), "scores", "shape (2,)", "shape (2, 1)"),
        ((np.zeros((2, 3)), np.zeros(2)), "boxes_px", "shape (2, 4)", "shape (2, 3)"),
        ((np.zeros(2), np.zeros(2)), "boxes_px", "shape (2, 4)", "shape (2,)"),
    ],
    ids=["length", "a column too many", "row", "flat"],
)
def test_columns_of_other_lengths_or_shapes_are_errors(columns, where, expected, found):
    with pytest.raises(PerceptionError) as error:
        Detections(*columns, np.full(2, "Car"))
    assert error.value.where == f"Detections.{where}"
    assert (error.value.expected, error.value.found) == (expected, found)


def test_a_table_as_a_column_has_the_length_of_the_others():
    with pytest.raises(PerceptionError) as error:
        Tracks.unclassified(np.arange(2), Boxes3D.empty(), np.zeros((2, 2)), np.zeros(2, bool))
    assert (error.value.where, error.value.found) == ("Tracks.boxes", "shape (0,)")

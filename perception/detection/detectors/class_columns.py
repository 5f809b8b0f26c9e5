"""Classes of a network and the classes of this package that they become.

COCO's car becomes Car, its truck and bus Truck, its person Pedestrian, a person on a
bicycle Cyclist; its kite is left out.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Self

import numpy as np

from perception.detection.onnx_model import Array
from perception.types import Float32

# Classes of COCO in their order, counted from 0.
COCO_CLASSES = tuple(
    """person,bicycle,car,motorcycle,airplane,bus,train,truck,boat,traffic light,fire hydrant,stop sign,parking meter,
bench,bird,cat,dog,horse,sheep,cow,elephant,bear,zebra,giraffe,backpack,umbrella,handbag,tie,suitcase,frisbee,skis,
snowboard,sports ball,kite,baseball bat,baseball glove,skateboard,surfboard,tennis racket,bottle,wine glass,cup,fork,
knife,spoon,bowl,banana,apple,sandwich,orange,broccoli,carrot,hot dog,pizza,donut,cake,chair,couch,potted plant,bed,
dining table,toilet,tv,laptop,mouse,remote,keyboard,cell phone,microwave,oven,toaster,sink,refrigerator,book,clock,
vase,scissors,teddy bear,hair drier,toothbrush""".replace("\n", "").split(",")
)
# Numbers of these classes in COCO's files, which leave out ten numbers between 1 and 90.
_UNUSED_COCO_NUMBERS = {12, 26, 29, 30, 45, 66, 68, 69, 71, 83}
COCO_NUMBERS = tuple(n for n in range(1, 91) if n not in _UNUSED_COCO_NUMBERS)

# Classes of this package by the names that data sets give them.
KNOWN_CLASSES: Mapping[str, str] = {
    "car": "Car",
    "van": "Van",
    "truck": "Truck",
    "bus": "Truck",
    "pedestrian": "Pedestrian",
    "person": "Pedestrian",
    "cyclist": "Cyclist",
    "person + bicycle": "Cyclist",
}
RIDDEN = " + "  # between the person and what carries it


@dataclass(frozen=True)
class ClassColumns:
    """Classes that a detector reports, and the numbers of the network's classes that count as each.

    Attributes:
        names: (C,) names of the reported classes.
        columns: (C,) numbers of the network's classes.
        persons_of: Class of persons by the class of riders, whose boxes are those of what they ride.
    """

    names: tuple[str, ...]
    columns: tuple[tuple[int, ...], ...]
    persons_of: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def identity(cls, names: Sequence[str]) -> Self:
        """Return classes that are reported as the network counts them."""
        return cls(tuple(names), tuple((number,) for number in range(len(names))))

    @classmethod
    def of_numbers(
        cls, reported: Mapping[int, str], persons_of: Mapping[str, str] | None = None
    ) -> Self:
        """Return the classes that numbers of the network's classes count as, each where it first stands."""
        columns: dict[str, list[int]] = {}
        for number, name in reported.items():
            columns.setdefault(name, []).append(number)
        numbers = tuple(tuple(of_class) for of_class in columns.values())
        return cls(tuple(columns), numbers, persons_of or {})

    def of_scores(self, scores: Float32) -> Float32:
        """Return (K, C) scores of the reported classes for (K, S) scores of the network's classes."""
        if self.columns == tuple((number,) for number in range(scores.shape[1])):
            return scores
        reported: Float32 = scores[:, [first for first, *_ in self.columns]]
        for number, (_, *others) in enumerate(self.columns):
            for other in others:
                np.maximum(reported[:, number], scores[:, other], out=reported[:, number])
        return reported

    def of_labels(self, labels: Array, scores: Float32) -> Float32:
        """Return (K, C) scores of the reported classes for (K,) numbers of classes with one score each."""
        is_class = np.stack([np.isin(labels, numbers) for numbers in self.columns], axis=1)
        return np.where(is_class, scores[:, None], np.float32(0))

"""Names of the kinds of streets."""

from typing import Literal

StreetKind = Literal[
    "town", "housing", "main-road", "junction", "country",
    "industrial", "cycling", "shopping", "park", "jam", "field", "tunnel",
]  # fmt: skip

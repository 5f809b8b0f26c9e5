"""JSON of users and of strangers, in which a key stands once: of two values for it `json` keeps the last in silence."""

import json
from collections import Counter
from collections.abc import Sequence
from typing import Any


class RepeatedKeyError(ValueError):
    """A key that an object of a document has twice."""


def read_json_text(text: str) -> Any:  # noqa: ANN401 - any document
    """Return the values of a JSON document.

    Raises:
        ValueError: It is damaged, has values too deep in each other, or a key twice in one object.
    """
    try:
        return json.loads(text, object_pairs_hook=_with_keys_once)
    except RecursionError as error:
        raise ValueError("values too deep in each other") from error


def _with_keys_once(pairs: Sequence[tuple[str, Any]]) -> dict[str, Any]:
    result = dict(pairs)
    if len(result) < len(pairs):
        (repeated, _), *_ = Counter(key for key, _ in pairs).most_common(1)
        raise RepeatedKeyError(f"{repeated!r} twice in one object")
    return result

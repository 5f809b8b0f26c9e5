"""Classes of a network: each needs labels to learn from, and enough of them to measure by."""

import difflib
import logging
from collections import Counter
from collections.abc import Sequence

from perception.errors import LabelError
from perception.evaluation.detection.protocol import RECALL_STEPS

log = logging.getLogger(__name__)


def require_classes(class_names: Sequence[str], labels: Counter[str], where: str) -> None:
    """Validate that each class has labels, in any case of letters.

    Args:
        class_names: Classes that are asked for.
        labels: Number of labels of each type.
        where: Labels in words, for the error.

    Raises:
        LabelError: a class has none; its advice is the labelled type of the nearest name.
    """
    types = {name.lower(): name for name, count in labels.items() if count}
    missing = [name for name in class_names if name.lower() not in types]
    if not missing:
        return
    near = [
        types[name]
        for one in missing
        for name in difflib.get_close_matches(one.lower(), types, n=1)
    ]
    raise LabelError(
        where,
        expected=f"at least one {' and one '.join(missing)}",
        found=", ".join(f"{count} {name}" for name, count in labels.most_common()) or "no object",
        advice=f"write {', '.join(near)}" if near else "choose drives with such labels",
    )


def warn_of_few(class_names: Sequence[str], labels: Counter[str], where: str) -> None:
    """Warn of classes with too few objects for KITTI's average precision, which samples as many recalls."""
    counts = Counter[str]()
    for name, count in labels.items():
        counts[name.lower()] += count
    few = [
        f"{counts[name.lower()]} {name}"
        for name in class_names
        if counts[name.lower()] <= RECALL_STEPS
    ]
    if few:
        log.warning(
            "%s: expected more than %d objects of each class, for an average precision to rely on, found %s",
            where,
            RECALL_STEPS,
            ", ".join(few),
        )

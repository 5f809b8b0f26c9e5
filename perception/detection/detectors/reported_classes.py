"""Which of a network's classes a detector reports, by the names that its description, its metadata or COCO give them."""

from collections.abc import Collection, Mapping
from itertools import islice

from perception.detection.detectors.class_columns import KNOWN_CLASSES, RIDDEN, ClassColumns
from perception.errors import ModelError

_MAX_LISTED = 20  # names in an error


def listed(names: Collection[str]) -> str:
    """Return names with commas, the first of many."""
    rest = len(names) - _MAX_LISTED
    return ", ".join(islice(names, _MAX_LISTED)) + (f" and {rest} more" if rest > 0 else "")


def reported_classes(
    names: Mapping[int, str],
    count: int | None,
    required: Mapping[str | int, str] | None,
    file: str,
) -> ClassColumns:
    """Return the reported classes.

    Args:
        names: Names of the network's classes by number, none where they are not known.
        count: Number of the network's classes, None where its outputs do not tell.
        required: Reported class by number or name of the network's class, None for those with known names.
        file: Name of the file.

    Raises:
        ModelError: the names of the network's classes are not known, or a class is none of them.
    """
    numbers = {name.lower(): number for number, name in names.items()}
    required = required or {
        name: reported
        for name, reported in KNOWN_CLASSES.items()
        if all(part in numbers for part in name.split(RIDDEN))
    }
    if not required:
        raise ModelError(
            file,
            expected=f"classes by the names {', '.join(KNOWN_CLASSES)}, or the 80 classes of COCO",
            found=listed(names.values()) or f"{count} classes",
            advice="state `classes` in a YAML file beside it, such as {0: Car}",
        )
    reported: dict[int, str] = {}
    persons_of = {}
    for key, name in required.items():
        # Of "person + bicycle", the bicycle is reported until a person is found on it.
        person, _, carrier = str(key).lower().rpartition(RIDDEN)
        if person:
            persons_of[name] = reported.get(numbers.get(person, -1), "")
            if not persons_of[name]:
                expected = f"an entry of {person} before {key}"
                raise ModelError(file, expected=expected, found=", ".join(map(str, required)))
        number = numbers.get(carrier) if isinstance(key, str) else key
        if number is None or (count is not None and not 0 <= number < count):
            known = listed(names.values()) or f"a number from 0 to {count}"
            raise ModelError(file, expected=f"classes of the network: {known}", found=str(key))
        reported[number] = name
    return ClassColumns.of_numbers(reported, persons_of)

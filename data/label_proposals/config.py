"""Which proposals become labels, and of which form."""

from dataclasses import dataclass
from pathlib import Path

from data.box_labels.form_names import LabelFormName
from perception.errors import UsageError


@dataclass(frozen=True)
class ProposedLabelConfig:
    """Labels.

    Attributes:
        form: Form of the labels in OUT/boxes: those of `trifuse run --label-form`, but for images.
        min_confidence: Confidence from which a box is a label without a decision, 0 to 1.
        review: Decisions that OUT/review.html has saved, by which the labels are written again from OUT/proposals.json.
    """

    form: LabelFormName = "openlabel"
    min_confidence: float = (
        0.4  # half of an F1 of 0.8, the best limit where confidences are probabilities
    )
    review: Path | None = None

    def __post_init__(self) -> None:
        """Validate that labels are boxes in space, and the range of the confidence."""
        if self.form in ("coco", "yolo"):
            expected = "a form of labels with 3D boxes"
            raise UsageError(f"--form {self.form}", expected=expected, found="one of images")
        if not 0 <= self.min_confidence <= 1:
            found = f"{self.min_confidence:g}"
            raise UsageError("--min-confidence", expected="0 to 1", found=found)

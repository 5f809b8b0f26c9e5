"""Parameters of H-Fus beside those that the thesis prints (Table 7.5)."""

from collections.abc import Mapping

from perception.evaluation.report import Table, Value, value_table
from perception.tracking.single_object.config import SingleObjectTrackerConfig

_PRINTED = (5, 4, 5, 1, 20, 8)


def fusion_parameters(config: SingleObjectTrackerConfig) -> Table[Mapping[str, Value]]:
    """Return Table 7.5 with the values that are used above the printed ones."""
    fusion = config.fusion
    used: dict[str, Value] = {
        "shifts in the scan": fusion.points.max_iterations,
        "shifts in the image": fusion.image.max_iterations,
        "tolerance [cm]": 100 * fusion.points.tolerance_m,
        "tolerance [px]": fusion.image.tolerance_px,
        "d_min [cm]": 100 * config.point.min_height_m,
        "bins per channel": fusion.colors.bins_per_channel,
    }
    printed: dict[str, Value] = dict(zip(used, _PRINTED, strict=True))
    rows = {"h-fus": used, "thesis": printed}
    return value_table("Table 7.5: parameters of H-Fus", rows, "g")

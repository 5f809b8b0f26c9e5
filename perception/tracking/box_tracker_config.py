"""Every choice of the box tracker, with its default."""

from dataclasses import dataclass, field

from perception.tracking.heading import HeadingConfig
from perception.tracking.motion_model import MotionModelConfig
from perception.tracking.size_estimate import SizeEstimateConfig
from perception.tracking.track_lifecycle import TrackLifecycleConfig


@dataclass(frozen=True)
class BoxTrackerConfig:
    """Every choice of the tracker.

    Attributes:
        motion: how things move and are seen.
        heading: what tells a heading.
        size: what is believed of sizes.
        life: when a track is believed and when it ends.
        height_gain: share of the way to a new height that a track's height goes.
        fragment_margin_m: beyond a track's expected box, within which things are parts of one.
        fragment_share: of the points of the largest part, which another part may have at most.
        static_margin_m: by which a standing thing may be larger than the track that it continues.
        static_reach_m: from a standing thing of the scan before, within which one is the same.
        static_min_share: of the size seen last that it must have.
    """

    motion: MotionModelConfig = field(default_factory=MotionModelConfig)
    heading: HeadingConfig = field(default_factory=HeadingConfig)
    size: SizeEstimateConfig = field(default_factory=SizeEstimateConfig)
    life: TrackLifecycleConfig = field(default_factory=TrackLifecycleConfig)
    height_gain: float = 0.3
    static_margin_m: float = 0.5
    static_min_share: float = 0.6
    static_reach_m: float = 0.3
    fragment_margin_m: float = 0.3
    fragment_share: float = 0.5

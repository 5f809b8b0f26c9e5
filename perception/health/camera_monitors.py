"""Monitors of the camera: an image that is missing, dark, washed out, frozen, or blurred in parts.

Thresholds are grey levels and shares of an image, not those of one drive. What differs from scene to scene, the detail
of each part of the image, is learned over the drive and compared with itself.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np

from perception.health.image_statistics import ImageStatistics, SampledReturns
from perception.types import CAMERA, Bool, Float, Frame, Health, HealthFinding, HealthLevel, UInt8

# A lit street at night has lamps and headlights above 100; a covered lens has read noise below 20.
_MAX_DARK = 24.0
_MAX_DIM = 48.0
# Contrast between the brightest and the darkest half per cent; fog and glare on KITTI leave above 100.
_MIN_CONTRAST, _MIN_GOOD_CONTRAST = 40.0, 70.0
_MIN_WHITE_MEDIAN = 245.0
# A camera slower than the LiDAR repeats images, too: as often as it has done before.
_MIN_REPEATS = 3
# Detail: cells with an edge in them, of which the fine part falls behind the coarse one.
_MIN_COARSE = 4.0
_MAX_DETAIL = 0.75  # of what the cell has had; a blur of 2 pixels leaves 0.6, of 3 pixels 0.55
_MIN_USUAL_COARSE = 6.0
_MAX_CHANGE = 20.0  # grey levels, of a covered cell
_MAX_COVERED = 0.45  # of the coarse detail that the cell has had
# Cells side by side, of 96: clean frames at 10 Hz have up to 7, at 5 Hz up to 10; the longer from frame to frame, the more.
_MIN_CELLS, _CELLS_1_S, _USUAL_PERIOD_S = 10, 20.0, 0.1
# At the mouth of a tunnel walls fill the view more and more, and light changes all over the image: cells are lost one
# after another. Of all that are lost for two frames, those of a fault are such a share, or they are a quarter of the image.
_MIN_AT_ONCE, _LOST_FRAMES, _MANY_CELLS = 0.375, 2, 24
# What comes near, as a lorry that passes, hides what was behind: cells of columns where the nearest return is at such
# a share of its distance before. A spot on the lens brings nothing near.
_MAX_NEARED, _MAX_NEARED_SHARE, _BEFORE_FRAMES, _KEPT_FRAMES = 0.4, 0.6, 3, 40
# A fault stays until most of its cells have their detail again, so many frames in a row.
_RECOVERED_SHARE, _RECOVERED_FRAMES = 0.5, 3
_DETAIL_FRAMES, _LEARNING_FRAMES = 5, 6
_NEWEST, _NEWEST_LOST = 0.1, 0.02


class AllCameraMonitors:
    """The monitors of each camera."""

    def __init__(self) -> None:
        self._cameras: dict[str, CameraMonitors] = {}

    def update(self, frame: Frame) -> Health:
        """Return the health of the cameras in a frame."""
        found: list[HealthFinding] = []
        for number, view in enumerate(frame.views):
            part = camera_part(view.camera, is_main=number == 0)
            found += self._cameras.setdefault(part, CameraMonitors(part)).update(view)
        return Health.of(found)


def without_failed_cameras(frame: Frame, health: Health) -> Frame:
    """Return the frame without the images of cameras with an ERROR."""
    if health.level < HealthLevel.ERROR:
        return frame
    further = tuple(
        replace(one, image=None)
        if health.level_of(camera_part(one.name, is_main=False)) is HealthLevel.ERROR
        else one
        for one in frame.further_cameras
    )
    image = None if health.level_of(CAMERA) is HealthLevel.ERROR else frame.image
    return replace(frame, image=image, further_cameras=further)


def camera_part(name: str, *, is_main: bool) -> str:
    """Return the name of a camera among the parts of a health."""
    return CAMERA if is_main else f"{CAMERA} {name}"


class CameraMonitors:
    """All monitors of one camera; one finding a frame, of the fault that explains the others."""

    def __init__(self, part: str = CAMERA) -> None:
        """Start without an image.

        Args:
            part: Name of the camera among the parts of a health.
        """
        self._part = part
        self._has_seen = False
        self._frozen = _FrozenImage()
        self._blurred = _BlurredImage()

    def update(self, frame: Frame) -> Sequence[HealthFinding]:
        """Return the findings of a frame; none of a drive without a camera."""
        if frame.image is None:
            is_missing, error = self._has_seen, HealthLevel.ERROR
            reason = "the frame has no image, those before it had one"
            return (
                [HealthFinding(self._part, error, "camera missing", reason)] if is_missing else []
            )
        self._has_seen = True
        image = ImageStatistics.of(frame.image)
        repeats = self._frozen.update(image.sample)
        finding = _dark(image) or repeats or _washed_out(image)
        if finding is None or finding[0] < HealthLevel.ERROR:
            blurred = self._blurred.update(image, SampledReturns.of(frame), frame.stamp_s)
            if finding and blurred:  # which it explains, and which makes it worse
                finding = (blurred[0], *finding[1:])
            finding = finding or blurred
        return [HealthFinding(self._part, *finding)] if finding else []


# Level, fault and reason of a finding.
_Fault = tuple[HealthLevel, str, str]


def _dark(image: ImageStatistics) -> _Fault | None:
    """Find an image without light."""
    if image.high >= _MAX_DIM:
        return None
    is_dark = image.high < _MAX_DARK
    reason = (
        f"99.5 % of the pixels are below {image.high + 1:.0f} of 255, expected above {_MAX_DIM:.0f}"
    )
    return HealthLevel.ERROR if is_dark else HealthLevel.WARN, "camera dark", reason


def _washed_out(image: ImageStatistics) -> _Fault | None:
    """Find an image without contrast, or one that is white."""
    contrast = image.high - image.low
    is_white = image.median >= _MIN_WHITE_MEDIAN
    if contrast >= _MIN_GOOD_CONTRAST and not is_white:
        return None
    is_error = contrast < _MIN_CONTRAST or is_white
    reason = (
        f"grey levels from {image.low:.0f} to {image.high:.0f} around {image.median:.0f}, "
        f"expected {_MIN_GOOD_CONTRAST:.0f} levels of contrast and a median below {_MIN_WHITE_MEDIAN:.0f}"
    )
    return HealthLevel.ERROR if is_error else HealthLevel.WARN, "camera washed out", reason


class _FrozenImage:
    """Finds images that are equal to the last bit: of a scene that stands still, noise differs."""

    def __init__(self) -> None:
        self._last: UInt8 | None = None
        self._repeats = self._usual_repeats = 0

    def update(self, sample: UInt8) -> _Fault | None:
        """Return the fault where an image repeats more often than images of this camera do."""
        if self._last is None or not np.array_equal(sample, self._last):
            # A camera that had frozen is no camera that repeats its images.
            if self._repeats < max(_MIN_REPEATS, self._usual_repeats + 1):
                self._usual_repeats = max(self._usual_repeats, self._repeats)
            self._last, self._repeats = sample, 0
            return None
        self._repeats += 1
        if self._repeats < max(_MIN_REPEATS, self._usual_repeats + 1):
            return None
        reason = f"the image is that of {self._repeats} frames ago to the last bit"
        return HealthLevel.ERROR, "camera frozen", reason


class _BlurredImage:
    """Finds parts of an image that lose their detail at once, and stay so: no wall and no lorry comes so suddenly.

    The fine detail of a cell is the difference of pixels that are near by that of pixels that are far apart. Both fall
    alike where a smooth wall comes into view, but a blur takes the fine one; an opaque spot takes both. The cells of a
    fault keep what they have had to compare with until they recover: dirt that stays is not learned as the scene.
    """

    def __init__(self) -> None:
        self._frames = 0
        self._coarse: Float = np.zeros(0)
        self._detail = self._edges_seen = self._lasts = self._coarse
        self._mean: Float = self._coarse
        self._held: Bool = np.zeros(0, bool)
        self._recovered = 0
        self._last_s, self._min_cells = np.inf, float(_MIN_CELLS)
        self._returns: deque[SampledReturns] = deque(maxlen=_KEPT_FRAMES)

    def update(
        self, image: ImageStatistics, returns: SampledReturns, stamp_s: float
    ) -> _Fault | None:
        """Return the fault where so many cells have lost their detail in the same frame.

        Args:
            image: Statistics of the image.
            returns: Returns of the scan.
            stamp_s: Time of the image.
        """
        longer_s = max(stamp_s - self._last_s - _USUAL_PERIOD_S, 0.0)
        self._last_s, self._min_cells = stamp_s, _MIN_CELLS + _CELLS_1_S * longer_s
        self._returns.append(returns)
        has_edges: Bool = image.coarse >= _MIN_COARSE
        detail = image.fine / np.maximum(image.coarse, 1e-3)
        if self._frames == 0:
            self._coarse, self._detail = image.coarse.copy(), detail
            self._mean = image.mean
            self._edges_seen, self._lasts = np.zeros_like(detail), np.zeros_like(detail)
            self._held = np.zeros(detail.shape, bool)
        self._frames += 1
        is_known = (self._edges_seen >= _LEARNING_FRAMES) & (self._coarse >= _MIN_USUAL_COARSE)
        is_blurred = has_edges & (detail < _MAX_DETAIL * self._detail)
        # A spot on the lens keeps its grey level; what passes by has windows, shadows and ends.
        is_same = (self._lasts == 0) | (np.abs(image.mean - self._mean) < _MAX_CHANGE)
        is_covered = (image.coarse < _MAX_COVERED * self._coarse) & is_same
        is_lost = is_known & (is_blurred | is_covered)
        self._mean = np.where(is_lost & (self._lasts > 0), self._mean, image.mean)
        self._lasts = np.where(is_lost, self._lasts + 1, 0)
        rate = np.where(is_lost, _NEWEST_LOST, np.maximum(_NEWEST, 1 / (self._edges_seen + 1)))
        rate = np.where(self._held, 0, rate)
        self._coarse = self._coarse + rate * (image.coarse - self._coarse)
        self._detail = self._detail + rate * has_edges * (detail - self._detail)
        self._edges_seen = self._edges_seen + (has_edges & ~is_lost)
        self._held |= self._lost_at_once()
        return self._fault(is_lost)

    def _fault(self, is_lost: Bool) -> _Fault | None:
        """Return the fault of the cells that are held, and let go of them where most have recovered."""
        held = int(self._held.sum())
        if not held:
            return None
        lost = int((self._held & is_lost).sum())
        self._recovered = self._recovered + 1 if lost < _RECOVERED_SHARE * held else 0
        if self._recovered >= _RECOVERED_FRAMES:
            self._held[:], self._recovered = False, 0
            return None
        share = held / self._held.size
        reason = f"{share:.0%} of the image have lost their detail at once, as behind dirt, water or a lens out of focus"
        # A detector makes more false boxes of such an image than the maps lack without it.
        return HealthLevel.ERROR, "camera blurred", reason

    def _lost_at_once(self) -> Bool:
        """Return the cells side by side that were lost within two frames, some frames ago; none where they are few."""
        lasts = self._lasts.astype(np.int64)
        ages = np.bincount(lasts.ravel())
        together = np.append(ages[:-1] + ages[1:], ages[-1])
        together[:_DETAIL_FRAMES] = 0
        age = int(together.argmax())
        if together[age] < self._min_cells:
            return np.zeros(lasts.shape, bool)
        largest = _largest_group((lasts == age) | (lasts == age + 1))
        count = int(largest.sum())
        lost = int((lasts >= _LOST_FRAMES).sum())
        is_at_once = count >= min(_MIN_AT_ONCE * lost, _MANY_CELLS)
        is_fault = is_at_once and count >= self._min_cells and not self._is_hidden(largest, age)
        return largest if is_fault else np.zeros(lasts.shape, bool)

    def _is_hidden(self, cells: Bool, age: int) -> bool:
        """Return whether something has come near in most of some cells since they were lost."""
        before = self._returns[max(len(self._returns) - 1 - age - _BEFORE_FRAMES, 0)]
        since_m = np.min([one.nearest_m for one in list(self._returns)[-age:]], axis=0)
        has_neared = since_m < _MAX_NEARED * before.nearest_m
        return bool((cells & has_neared).sum() > _MAX_NEARED_SHARE * cells.sum())


def _largest_group(cells: Bool) -> Bool:
    """Return the cells of the largest group that hangs together, by sides or corners."""
    _, groups = cv2.connectedComponents(cells.astype(np.uint8))
    sizes = np.bincount(groups.ravel())[1:]
    return np.asarray(groups == 1 + int(sizes.argmax())) if len(sizes) else cells

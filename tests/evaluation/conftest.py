"""Sequences for the tracking measures, and a real scene of nuScenes."""

import tarfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from perception.evaluation.multi_object.sequence import TrackedFrame

Frames = list[TrackedFrame]
_SHARED = Path(__file__).parents[3] / "shared"


@pytest.fixture
def frame_of() -> Callable[..., TrackedFrame]:
    """Return what makes a frame of plain lists: the ids of truths and tracks, and their similarity."""

    def make(truths: list[int], tracks: list[int], similarity: list[list[float]]) -> TrackedFrame:
        table = np.array(similarity, float).reshape(len(truths), len(tracks))
        return TrackedFrame(np.array(truths, int), np.array(tracks, int), table)

    return make


@pytest.fixture(params=range(6))
def crowd(request: pytest.FixtureRequest) -> Frames:
    """Return a sequence of many rivals, with frames without an object, or nothing is predicted."""
    rng = np.random.default_rng(request.param)
    count = int(rng.integers(3, 12))
    frames = []
    for _ in range(40):
        truths = rng.permutation(count)[: rng.integers(0, count + 1)]
        tracks = rng.permutation(count)[: rng.integers(0, count + 1)]
        alike = rng.random((len(truths), len(tracks)))
        # Of one name, as if followed, most of the time; others are alike by chance.
        is_own = (truths[:, None] == tracks) & (rng.random(alike.shape) < 0.8)
        similarity = np.where(is_own, 0.4 + 0.6 * alike, np.clip(1.3 * alike - 0.5, 0, 1))
        frames.append(TrackedFrame(10 * truths + 7, 3 * tracks + 100, similarity))
    return frames


def renamed(frames: Frames, rng: np.random.Generator) -> Frames:
    """Return frames with other ids, and their rows in another order."""
    changed = []
    for frame in frames:
        rows, columns = (rng.permutation(n) for n in frame.similarity.shape)
        ids = -frame.truth_ids[rows], frame.track_ids[columns] ** 2
        changed.append(TrackedFrame(*ids, frame.similarity[rows][:, columns]))
    return changed


@pytest.fixture(scope="session")
def nuscenes_tables(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the root of the tables of a real scene, without its scans."""
    archive = _SHARED / "nuscenes" / "scene-0916_lidar.tar.xz"
    if not archive.is_file():
        pytest.skip("no shared nuScenes scene beside the checkout")
    root = tmp_path_factory.mktemp("scene")
    with tarfile.open(archive) as tar:
        tar.extractall(root, [one for one in tar if one.name.endswith(".json")], filter="data")
    return root

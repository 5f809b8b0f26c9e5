"""The curves of a few settings rest on the same frames and proposals as the counts of the search."""

from perception.detection.config import ProposalConfig
from tests.car_frames import write_car_frames
from train.proposal_search.grid import SearchGrid
from train.proposal_search.recall import ProposalSetting, measure_recall
from train.proposal_search.search import SearchConfig, search
from train.proposal_search.survey import survey


def test_recall_of_all_labels_is_what_the_search_counted(tmp_path):
    root = write_car_frames(tmp_path / "object", frames=3)
    grid = SearchGrid((0.5,), (0.01,), (2,), (0.05, 0.5))
    config = SearchConfig(survey([root], "car"), grid, "thesis", chunk_frames=2)
    table = search(config, tmp_path / "counts.jsonl")
    settings = {str(count): ProposalSetting(count.parameters, "thesis") for count in table}
    recalls = measure_recall(config, settings, "points")
    for count, recall in zip(table, recalls.values(), strict=True):
        metrics = recall.difficulties["all"]
        assert metrics.objects == count.objects == 6
        assert (metrics.found(0.7), metrics.found(0.5)) == count.reached
        assert recall.proposals == count.proposals
        assert recall.frames == 3


def test_a_frame_that_cannot_be_read_is_passed_over(tmp_path):
    root = write_car_frames(tmp_path / "object", frames=3)
    (root / "training" / "velodyne" / "000000.bin").write_bytes(b"12345")
    config = SearchConfig(survey([root], "Car"), chunk_frames=1, on_bad_frame="skip")
    settings = {"default": ProposalSetting(ProposalConfig())}
    (recall,) = measure_recall(config, settings, "size").values()
    assert recall.frames == 2
    assert recall.difficulties["all"].recall(0.5) == 1

"""`trifuse shards`."""

from pathlib import Path

from perception.cli.flags import require_positive
from perception.types import Fit, MapFilling, Modality, OnBadFrame


def shards(
    roots: list[Path],
    *,
    out: str,
    modality: Modality,
    size: str = "192x640",
    filling: MapFilling = "default",
    jpeg_quality: int | None = None,
    fit: Fit = "letterbox",
    split: Path | None = None,
    samples: int = 256,
    seed: int = 0,
    workers: int | None = None,
    overwrite: bool = False,
    on_bad_frame: OnBadFrame = "stop",
) -> None:
    """Write the samples of labelled drives as tar files from which trainings stream, here or in an object store.

    Training takes the folder or URL by --shards and reads one file after another, so that it needs no copy on disk. The
    files are those of WebDataset: NAME.dm.png and NAME.rm.png, or NAME.rgb.png, and NAME.json with the labels. A URL such
    as s3://bucket/frames needs the package of its kind: s3fs, gcsfs, adlfs.

    Example: trifuse shards synth/train --modality dm --out s3://bucket/frames

    Args:
        roots: Labelled drives of any layout; of a folder of several, all are taken.
        out: Folder or URL of the shards.
        modality: Camera image, rgb; or depth map, dm, or reflectance map, rm, which are written both.
        size: Height and width of the input, as in the training.
        filling: Method by which maps are made dense, as in the training.
        jpeg_quality: Quality of the JPEG compression of the input, as in the training.
        fit: Letterbox, which keeps the aspect of images, or stretch, as in the training.
        split: File of `trifuse split`, of which part train is written; all frames by default.
        samples: Samples of a shard.
        seed: Seed of the order of the samples.
        workers: Number of processes; one per core by default.
        overwrite: Replace the shards that are there.
        on_bad_frame: Stop at a damaged frame, or skip it with a warning.
    """
    from data.open_drive import open_drives
    from data.remote_folder import RemoteFolder
    from data.samples.images.input_images import ImageConfig
    from data.samples.shards.writer import ShardSource, write_shards
    from data.splits.files import select_part
    from perception.cli.progress import frame_progress_bar
    from perception.detection.detectors.input_size import InputSize

    require_positive("--samples", samples)
    config = ImageConfig(
        modality, size=InputSize.parse(size), filling=filling, jpeg_quality=jpeg_quality, fit=fit
    )
    folder = RemoteFolder(out)
    drives, bar = select_part(open_drives(roots), split, "train"), frame_progress_bar("samples")
    source = ShardSource(drives, config, on_bad_frame, samples, seed)
    made = write_shards(source, folder, workers=workers, overwrite=overwrite, progress=bar)
    print(f"{made.samples} samples in {len(made.shards)} shards: {folder.url}")

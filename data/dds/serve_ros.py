"""From topics of ROS 2 through the pipeline to topics of ROS 2; any other live source may stand for the first."""

from data.dds.participant import DdsParticipant
from data.dds.result_publisher import RosFrames, RosPublisher
from data.dds.ros_source import RosSource
from data.layouts import OpenConfig
from data.live.serve import ServerAddress, serve_live
from data.live.source import LiveSource
from perception.pipeline import PipelineConfig


def serve_ros(
    live: LiveSource | None, reading: OpenConfig, config: PipelineConfig, address: ServerAddress
) -> None:
    """Run the pipeline; publish the results on topics, and to viewers as `serve_live` does.

    Args:
        live: Source of the frames; None for the topics of the domain.
        reading: How the topics are read.
        config: Pipeline configuration.
        address: Where viewers connect; its host is also the network interface of DDS.

    Raises:
        MissingDependencyError: cyclonedds is not installed.
        UsageError: A topic that was named is of another type, or an address cannot be used.
        KeyboardInterrupt: It was stopped.
    """
    with DdsParticipant(address.host) as participant:
        source = RosSource(participant, reading) if live is None else live
        robot = source if isinstance(source, RosSource) else None
        publisher = RosPublisher(
            participant,
            RosFrames() if robot is None else robot.frames,
            min_score=address.min_score,
            origin_ns=source.origin_ns,
            health=source.health,
            grid=config.occupancy,
        )
        source.on_silence = publisher.publish_health
        if robot is not None:
            robot.on_frames = publisher.use_frames
        serve_live(source, config, address, [publisher])

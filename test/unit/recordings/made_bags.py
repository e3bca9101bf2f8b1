"""ROS 2 bags with what a ROS 1 bag holds."""

from contextlib import closing

from mcap.writer import Writer as McapWriter
from rosbags.convert.converter import convert_1to2
from rosbags.rosbag1 import Reader, Writer

from recordings.bags.message_types import ros2_types


def write_ros1_bag(source, path, topics):
    """Write a .bag with some topics of another."""
    with Reader(source) as bag, closing(Writer(path)) as writer:
        writer.open()
        connections = {}
        for connection, time, raw in bag.messages():
            if connection.topic not in topics:
                continue
            if connection.id not in connections:
                connections[connection.id] = writer.add_connection(
                    connection.topic, connection.msgtype, msgdef=connection.msgdef, md5sum=connection.digest
                )
            writer.write(connections[connection.id], time, raw)
    return path


def write_sqlite_bag(source, folder, topics=()):
    """Write a folder with a .db3 file and metadata, with definitions, as ROS 2 Iron and newer do."""
    convert_1to2(source, folder, (), topics)
    return folder


def write_mcap(source, path, topics=None):
    """Write a single .mcap file with the writer of the format's authors."""
    with Reader(source) as bag, path.open("wb") as file:
        writer = McapWriter(file)
        writer.start(profile="ros2")
        channels = {}
        for connection, time, raw in bag.messages():
            if topics is not None and connection.topic not in topics:
                continue
            if connection.id not in channels:
                definition, _ = ros2_types().generate_msgdef(connection.msgtype, ros_version=2)
                schema = writer.register_schema(connection.msgtype, "ros2msg", definition.encode())
                channels[connection.id] = writer.register_channel(connection.topic, "cdr", schema)
            data = bytes(ros2_types().ros1_to_cdr(raw, connection.msgtype))
            writer.add_message(channels[connection.id], time, data, time)
        writer.finish()
    return path

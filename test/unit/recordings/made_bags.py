"""ROS 2 bags with what a ROS 1 bag holds."""

from contextlib import closing

from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Reader, Writer
from rosbags.rosbag2 import Writer as SqliteWriter

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


def write_sqlite_bag(source, folder, topics=None):
    """Write a folder with a .db3 file and metadata, with definitions, as ROS 2 Iron and newer do."""
    with Reader(source) as bag, closing(SqliteWriter(folder)) as writer:
        writer.open()
        connections = {}
        for connection, time, data in _messages(bag, topics):
            if connection.id not in connections:
                connections[connection.id] = writer.add_connection(
                    connection.topic, connection.msgtype, typestore=ros2_types()
                )
            writer.write(connections[connection.id], time, data)
    return folder


def write_mcap(source, path, topics=None):
    """Write a single .mcap file with the writer of the format's authors."""
    with Reader(source) as bag, path.open("wb") as file:
        writer = McapWriter(file)
        writer.start(profile="ros2")
        channels = {}
        for connection, time, data in _messages(bag, topics):
            if connection.id not in channels:
                definition, _ = ros2_types().generate_msgdef(connection.msgtype, ros_version=2)
                schema = writer.register_schema(connection.msgtype, "ros2msg", definition.encode())
                channels[connection.id] = writer.register_channel(connection.topic, "cdr", schema)
            writer.add_message(channels[connection.id], time, bytes(data), time)
        writer.finish()
    return path


def _messages(bag, topics):
    for connection, time, raw in bag.messages():
        if topics is None or connection.topic in topics:
            yield connection, time, ros2_types().ros1_to_cdr(raw, connection.msgtype)

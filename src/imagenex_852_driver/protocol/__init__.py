"""The protocol of the Imagenex 852: bytes to frozen dataclasses and back, without any input or output."""

from imagenex_852_driver.protocol.command import SwitchCommand
from imagenex_852_driver.protocol.command_reader import CommandReader
from imagenex_852_driver.protocol.errors import FrameError
from imagenex_852_driver.protocol.reply import Reply, ReplyKind
from imagenex_852_driver.protocol.reply_parser import ParsedReply, ParserCounts, ReplyParser

__all__ = [
    "CommandReader",
    "FrameError",
    "ParsedReply",
    "ParserCounts",
    "Reply",
    "ReplyKind",
    "ReplyParser",
    "SwitchCommand",
]

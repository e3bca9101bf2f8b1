"""Command line of map_tool."""

import argparse
from pathlib import Path
from typing import List

from mlsm_manager.surface_map.export.colors import ColorBy
from mlsm_manager.surface_map.export.formats import ENDINGS
from node_support.help import CommandLine

_MAPS = "a map (.mlsm, or a .ply of this package)"
_OUT = f"file to write, ending with one of {' '.join(ENDINGS)}"


def map_tool_arguments(arguments: List[str]) -> argparse.Namespace:
    """Return `command` and what it needs; exits on a bad command line."""
    parser = CommandLine("map_tool", description="Look at, export, crop, merge and compare maps.")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND")
    commands.required = True
    info = commands.add_parser("info", help="say what maps hold")
    info.add_argument("maps", type=Path, nargs="+", metavar="FILE", help=_MAPS)
    view = commands.add_parser("view", help="show a map in a window; without a screen write a picture")
    _add_map(view)
    _add_colors(view)
    _add_export(commands.add_parser("export", help="write a map in another format"))
    _add_crop(commands.add_parser("crop", help="keep what lies in a box"))
    _add_merge(commands.add_parser("merge", help="make one map of two"))
    _add_two_maps(commands.add_parser("diff", help="say what only one of two maps has"))
    return parser.parse_args(arguments)


def _add_export(parser: argparse.ArgumentParser) -> None:
    _add_map(parser)
    parser.add_argument("out", type=Path, metavar="OUT", help=_OUT)
    parser.add_argument(
        "--slice", type=float, nargs=2, default=(float("-inf"), float("inf")), metavar=("LOW", "HIGH"),
        help="heights between which a .pgm shows what is occupied [m] (default: all)",
    )  # fmt: skip
    _add_colors(parser)


def _add_crop(parser: argparse.ArgumentParser) -> None:
    _add_map(parser)
    parser.add_argument("out", type=Path, metavar="OUT", help=_OUT)
    for option, corner in (("--low", "lower"), ("--high", "upper")):
        parser.add_argument(
            option, type=float, nargs="+", required=True, metavar=("X", "Y"),
            help=f"the box's {corner} corner, X Y or X Y Z [m]",
        )  # fmt: skip


def _add_merge(parser: argparse.ArgumentParser) -> None:
    _add_two_maps(parser)
    parser.add_argument("out", type=Path, metavar="OUT", help=_OUT)
    parser.add_argument(
        "--transform", type=float, nargs=4, default=(0.0, 0.0, 0.0, 0.0), metavar=("X", "Y", "Z", "YAW"),
        help="where the second map's origin lies in the first [m, deg] (default: at its origin)",
    )  # fmt: skip


def _add_map(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("map", type=Path, metavar="MAP", help=_MAPS)


def _add_two_maps(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("first", type=Path, metavar="FIRST", help=_MAPS)
    parser.add_argument("second", type=Path, metavar="SECOND", help=_MAPS)


def _add_colors(parser: argparse.ArgumentParser) -> None:
    names = [by.value.lower() for by in ColorBy]
    parser.add_argument("--color", choices=names, default="height", help="what blocks are coloured by")

"""map_tool: looks at, exports, crops, merges and compares maps."""

import argparse
import os
import sys
import time
from argparse import Namespace
from pathlib import Path
from typing import Callable, Dict, List

import numpy as np

from georeferencing.origin import STORED
from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.export.formats import ENDINGS, GEOTIFF, ExportOptions, export
from mlsm_manager.surface_map.export.pictures import ColorBy, has_screen, show
from mlsm_manager.surface_map.map_file import read_map
from mlsm_manager.surface_map.operations import LevelTransform, cropped, difference, merged
from node_support.files import check_output
from node_support.help import CommandLine, ending_in_one_line

_MAPS = "a map (.mlsm)"


def run_map_tool() -> None:
    """Run map_tool with the command line; ends with one line and status 1 when something is wrong with the input."""
    options = map_tool_arguments(sys.argv[1:])
    with ending_in_one_line("map_tool", ValueError):
        if "out" in options:
            read = [getattr(options, name) for name in ("map", "first", "second") if name in options]
            check_output(options.out, read, options.overwrite)
        lines = _COMMANDS[options.command](options)
    try:
        print("\n".join(lines), flush=True)
    except BrokenPipeError:
        # Whoever reads, such as `head`, stopped to do so; Python flushes again at its end, and would complain then.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _info(options: Namespace) -> List[str]:
    lines = []
    for path in options.maps:
        stored = read_map(path)
        made = "at a time not known"
        if stored.made:
            made = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(stored.made))
        lines.append(f"{path}: frame {stored.frame}, made {made}")
        lines += [f"  {layer.value}: {_layer_line(blocks)}" for layer, blocks in stored.layers.items()]
        lines += [f"  mark: {mark.name!r} at {mark.x:.1f}, {mark.y:.1f} m" for mark in stored.marks]
        lines += [f"  calibration: {name} = {value}" for name, value in sorted(stored.calibration.items())]
        lines += [] if stored.origin is None else [f"  origin: {stored.origin}"]
        arrays = {name: array for name, array in sorted(stored.arrays.items()) if name != STORED}
        lines += [f"  with {name} {'x'.join(map(str, array.shape))}" for name, array in arrays.items()]
    return lines


def _layer_line(blocks: Blocks) -> str:
    if not len(blocks):
        return f"no blocks of {blocks.resolution:g} m"
    low = [*(blocks.cells.min(axis=0) * blocks.resolution), blocks.bottom.min()]
    high = [*((blocks.cells.max(axis=0) + 1) * blocks.resolution), blocks.height.max()]
    box = ", ".join(f"{axis} {start:.1f} to {end:.1f} m" for axis, start, end in zip("xyz", low, high))
    return f"{len(blocks)} blocks of {blocks.resolution:g} m, {blocks.count.sum()} points, {box}"


def _view(options: Namespace) -> List[str]:
    stored, color_by = read_map(options.map), ColorBy(options.color.upper())
    if has_screen():
        show(stored.shown, options.map.name, color_by)
        return []
    picture = Path(f"{options.map.stem}.png")
    export(stored, picture, ExportOptions(color_by=color_by))
    return [f"no screen; {picture} written"]


def _export(options: Namespace) -> List[str]:
    low, high = options.slice
    if options.crs and options.out.suffix != GEOTIFF:
        raise ValueError(f"--crs {options.crs}: {options.out} must end with {GEOTIFF}")
    export(read_map(options.map), options.out, ExportOptions(low, high, ColorBy(options.color.upper()), options.crs))
    return [f"{options.out} written"]


def _crop(options: Namespace) -> List[str]:
    if not (len(options.low) == len(options.high) in (2, 3)):
        raise ValueError(f"--low {options.low} --high {options.high}: must both be X Y or both X Y Z")
    if any(low > high for low, high in zip(options.low, options.high)):
        raise ValueError(f"--low {options.low} --high {options.high}: low must not be above high")
    stored = cropped(read_map(options.map), np.array(options.low), np.array(options.high))
    if not len(stored):
        raise ValueError(f"{options.map}: the map has no blocks between {options.low} and {options.high}")
    export(stored, options.out, ExportOptions())
    return [f"{options.out}: {len(stored)} blocks"]


def _merge(options: Namespace) -> List[str]:
    x, y, z, yaw = options.transform
    transform = LevelTransform(x, y, z, np.radians(yaw))
    first, second = read_map(options.first), read_map(options.second)
    stored = merged(first, second, transform)
    export(stored, options.out, ExportOptions())
    exact = "exactly" if transform.keeps_cells(stored.shown.resolution) else "cells do not align, so to within a cell"
    return [f"{options.out}: {len(stored)} blocks of {len(first)} and {len(second)}, {exact}"]


def _diff(options: Namespace) -> List[str]:
    result = difference(read_map(options.first).shown, read_map(options.second).shown)
    lines = [
        f"{len(result.both)} blocks of {options.first.name} are in {options.second.name} too",
        f"{len(result.only_first)} are in {options.first.name} only",
        f"{len(result.only_second)} are in {options.second.name} only",
    ]
    if len(result.shift):
        middle, most = np.median(result.shift), np.abs(result.shift).max()
        lines.append(f"where both are, the second is higher by {middle:.3f} m (median), {most:.3f} m at most")
    return lines


_COMMANDS: Dict[str, Callable[[Namespace], List[str]]] = {
    "info": _info, "view": _view, "export": _export, "crop": _crop, "merge": _merge, "diff": _diff
}  # fmt: skip


def map_tool_arguments(arguments: List[str]) -> argparse.Namespace:
    """Return `command` and what it needs; exits on a bad command line."""
    parser = CommandLine("map_tool", description="Look at, export, crop, merge and compare maps.")
    one_map, two_maps, out, colors = (argparse.ArgumentParser(add_help=False) for _ in range(4))
    one_map.add_argument("map", type=Path, metavar="MAP", help=_MAPS)
    two_maps.add_argument("first", type=Path, metavar="FIRST", help=_MAPS)
    two_maps.add_argument("second", type=Path, metavar="SECOND", help=_MAPS)
    out.add_argument("out", type=Path, metavar="OUT", help=f"file to write, ending with one of {' '.join(ENDINGS)}")
    out.add_argument("--overwrite", action="store_true", help="replace a file that exists")
    names = [by.value.lower() for by in ColorBy]
    colors.add_argument("--color", choices=names, default="height", help="what blocks are coloured by")
    commands = parser.add_subparsers(dest="command", metavar="|".join(_COMMANDS))
    commands.required = True
    info = commands.add_parser("info", help="say what maps hold")
    info.add_argument("maps", type=Path, nargs="+", metavar="FILE", help=_MAPS)
    commands.add_parser("view", parents=[one_map, colors], help="show a map in a window; without one, write a picture")
    export_parser = commands.add_parser("export", parents=[one_map, out, colors], help="write a map in another format")
    export_parser.add_argument(
        "--slice", type=float, nargs=2, default=(-np.inf, np.inf), metavar=("LOW", "HIGH"),
        help="heights between which a .pgm shows what is occupied [m] (default: all)",
    )  # fmt: skip
    export_parser.add_argument(
        "--crs", default="", metavar="EPSG:CODE",
        help="coordinates of a .tif, of a map that knows where it lies (default: its zone of UTM)",
    )  # fmt: skip
    crop = commands.add_parser("crop", parents=[one_map, out], help="keep what lies in a box")
    for option, corner in (("--low", "lower"), ("--high", "upper")):
        crop.add_argument(
            option, type=float, nargs="+", required=True, metavar=("X", "Y"),
            help=f"the box's {corner} corner, X Y or X Y Z [m]",
        )  # fmt: skip
    merge = commands.add_parser("merge", parents=[two_maps, out], help="make one map of two")
    merge.add_argument(
        "--transform", type=float, nargs=4, default=(0.0, 0.0, 0.0, 0.0), metavar=("X", "Y", "Z", "YAW"),
        help="where the second map's origin lies in the first [m, deg] (default: at its origin)",
    )  # fmt: skip
    commands.add_parser("diff", parents=[two_maps], help="say what only one of two maps has")
    return parser.parse_args(arguments)

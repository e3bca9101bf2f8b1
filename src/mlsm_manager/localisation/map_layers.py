"""What the maps of a mapper are made from, copies of them, and what it tells of them."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Dict, Iterator, Mapping, Optional, Protocol, Tuple

import numpy as np

from mlsm_manager.surface_map.blocks import Blocks, BlockSource
from mlsm_manager.surface_map.files.map_file import Layer
from mlsm_manager.surface_map.free_space.carving import Carver
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from mlsm_manager.surface_map.running_copy import RunningCopy
from node_support.kernels import Kernel


@dataclass(frozen=True)
class MapSettings:
    """The grids of the map that is shown and of the map that is matched with.

    resolution, match_resolution: side of a cell, m. limit: greatest coordinate of a point, m. expected_blocks: number
    of blocks to reserve memory for. fewest_blocks: of a map that can be matched with.
    carver: what marks free space and takes blocks away that beams go through; None where that is not wanted.
    """

    resolution: float
    match_resolution: float
    limit: float
    expected_blocks: int
    fewest_blocks: int
    carver: Optional[Carver] = None
    kernel: Kernel = Kernel.NUMPY


class HasBlocks(Protocol):
    """What has blocks: a map, or the free space of keyframes."""

    @property
    def blocks(self) -> Blocks:
        """A copy of all of them."""

    def begin_copy(self) -> RunningCopy:
        """Return a copy of all of them as they are now, which is still to be made."""


class LayerCopies(Mapping[Layer, Blocks]):
    """The blocks of maps, copied when they are asked for."""

    def __init__(self, maps: Dict[Layer, HasBlocks]) -> None:
        self._maps = maps

    def __getitem__(self, layer: Layer) -> Blocks:
        return self._maps[layer].blocks

    def __iter__(self) -> Iterator[Layer]:
        return iter(self._maps)

    def __len__(self) -> int:
        return len(self._maps)


class ShowsMaps(ABC):
    """What a mapper tells of its maps."""

    @property
    @abstractmethod
    def _shown_map(self) -> MultiLevelSurfaceMap:
        """The map that is shown and saved."""

    @property
    @abstractmethod
    def _matched_map(self) -> MultiLevelSurfaceMap:
        """The map that scans are matched with."""

    @property
    @abstractmethod
    def _free_space(self) -> HasBlocks:
        """What is known to be free, in the map that is shown."""

    @property
    def blocks(self) -> Blocks:
        """The map that is shown."""
        return self._shown_map.blocks

    @property
    def block_count(self) -> int:
        """Number of blocks of the map that is shown."""
        return len(self._shown_map)

    @property
    def target(self) -> BlockSource:
        """The map in which a lost vehicle is searched."""
        return self._matched_map

    @property
    def layers(self) -> Mapping[Layer, Blocks]:
        """Copies of all maps, to be stored, each made when it is asked for."""
        return LayerCopies(self._by_layer)

    def begin_copy(self, layer: Layer) -> RunningCopy:
        """Return a copy of a map as it is now, which is still to be made."""
        return self._by_layer[layer].begin_copy()

    @property
    def _by_layer(self) -> Dict[Layer, HasBlocks]:
        return {Layer.SHOWN: self._shown_map, Layer.MATCHED: self._matched_map, Layer.FREE: self._free_space}

    def region(self, low: np.ndarray, high: np.ndarray) -> Blocks:
        """Return the blocks of the map that is shown in a box; see MultiLevelSurfaceMap.in_box."""
        return self._shown_map.in_box(low, high)

    def changed_tiles(self) -> Tuple[np.ndarray, Blocks]:
        """Return the tiles (n, 2) of the map that is shown that changed since the last call, and their blocks."""
        tiles = self._shown_map.take_changed_tiles()
        return tiles, self._shown_map.in_tiles(tiles)

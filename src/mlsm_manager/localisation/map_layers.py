"""What the maps of a mapper are made from, and copies of them."""

from dataclasses import dataclass
from typing import Dict, Iterator, Mapping, Optional, Protocol

from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.files.map_file import Layer
from mlsm_manager.surface_map.free_space.carving import Carver
from mlsm_manager.surface_map.insertion import InsertionKernel


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
    kernel: InsertionKernel = InsertionKernel.NUMPY


class HasBlocks(Protocol):
    """What has blocks: a map, or the free space of keyframes."""

    @property
    def blocks(self) -> Blocks:
        """A copy of all of them."""


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

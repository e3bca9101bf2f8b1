"""Parameters of web_page."""

from dataclasses import dataclass

from node_support.parameters import parameter
from sonar_processing.beams.reader import BeamMessageParameters


@dataclass(frozen=True)
class WebPageParameters(BeamMessageParameters):
    """Who may look, how much is sent, and what is shown."""

    host: str = parameter("127.0.0.1", "address that is served: 127.0.0.1 this machine alone, 0.0.0.0 every network")
    port: int = parameter(8080, "TCP port that is served; 0: any free one, which the log names", low=0, high=65535)
    bytes_per_second: float = parameter(
        28000.0, "most bytes for one page in a second, before they are compressed", low=4000.0, high=1e9
    )
    most_pages: int = parameter(32, "pages that may be open at once", low=1, high=1000)
    map_frame: str = parameter("map", "frame of the map")
    base_frame: str = parameter("base_link", "frame of the vehicle")
    cell: float = parameter(
        0.0, "side of a cell of the map; 0: as mlsm_core's parameter resolution says", unit="m", low=0.0, high=100.0
    )

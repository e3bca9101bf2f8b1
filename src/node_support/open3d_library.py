"""Open3D where it is installed: only processes that use it load it (0.3 s, 43 MB)."""

import importlib
import logging
from functools import lru_cache
from typing import Any, Optional

HOW_TO_INSTALL = "apt install python3-open3d"


@lru_cache(maxsize=None)
def open3d_or_none(otherwise: str) -> Optional[Any]:
    """Return the module open3d, or None; the first time that it is missing, one line says what is done `otherwise`."""
    try:
        return importlib.import_module("open3d")
    except ImportError:
        logging.getLogger(__name__).warning("Open3D is missing: %s; install it with: %s", otherwise, HOW_TO_INSTALL)
        return None

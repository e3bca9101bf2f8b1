"""What all pages show: of each thing the newest, with the number of its last change."""

import threading
from typing import Dict, Hashable, Iterable, Set, Tuple, Union

from node_support.thin_queue import ThinQueue

Item = Union[str, bytes]  # what a page gets as one message: text is JSON
NOW, WORDS, TRACK, BEAM, TILE = range(5)  # priorities, where the link is too thin for all of it


class Board:
    """Holds the newest item under each key, and lets it wait for every page that looks.

    Several threads may call it. A page that comes again after a cut link says which change it has seen last, and gets
    what is newer.
    """

    def __init__(self) -> None:
        self.lock = threading.RLock()
        self.run = ""
        """Name of the run that is shown: a page that knows another one begins anew."""
        self.revision = 0
        """Number of the newest change."""
        self._items: Dict[Hashable, Tuple[int, Item, int]] = {}
        self._pages: Set[ThinQueue] = set()

    @property
    def pages(self) -> int:
        return len(self._pages)

    def put(self, key: Hashable, item: Item, priority: int) -> None:
        """Show an item in the place of the older one with its key; one that is the same is not sent again."""
        with self.lock:
            if self._items.get(key, (0, None))[1] == item:
                return
            self.revision += 1
            self._items.pop(key, None)
            self._items[key] = self.revision, item, priority
            for page in self._pages:
                page.put(key, item, len(item), priority)

    def pass_on(self, key: Hashable, item: Item, priority: int) -> None:
        """Send an item to those who look now; nobody gets it later."""
        with self.lock:
            for page in self._pages:
                page.put(key, item, len(item), priority)

    def drop(self, keys: Iterable[Hashable]) -> None:
        """Forget what is under these keys, where there is anything."""
        with self.lock:
            known = [key for key in keys if self._items.pop(key, None) is not None]
            for page in self._pages:
                page.drop(known)

    def clear(self) -> None:
        with self.lock:
            self.drop(list(self._items))

    def open(self, page: ThinQueue, since: int) -> None:
        """Let everything that changed after the revision `since` wait for a new page."""
        with self.lock:
            self._pages.add(page)
            for key, (revision, item, priority) in reversed(self._items.items()):
                if revision <= since:
                    break
                page.put(key, item, len(item), priority)

    def close(self, page: ThinQueue) -> None:
        with self.lock:
            self._pages.discard(page)

"""Serves the page, and each page that is open what is new, by tornado in a thread of its own."""

import asyncio
import socket
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Callable, Set

from tornado.httpserver import HTTPServer
from tornado.ioloop import IOLoop
from tornado.iostream import StreamClosedError
from tornado.netutil import bind_sockets
from tornado.web import Application, RequestHandler, StaticFileHandler
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from node_support.errors import RefusedInput
from node_support.thin_queue import ThinQueue
from web_page.board import Board
from web_page.messages import LONGEST_REQUEST, Hello, MarkRequest, parsed, text_of
from web_page.parameters import WebPageParameters

_PERIOD = 0.25  # s between two looks for what is new
_SEND_BUFFER = 65536  # bytes that the system takes ahead of a slow link: what waits here is replaced by what is newer
_PING, _PONG = 5.0, 15.0  # s: after so long without an answer a page is gone
_LARGEST_HEADER = 16384  # bytes of a request
_REQUEST_PERIOD = 0.2  # s between two requests of one page: nobody clicks faster
_TOO_MANY = 1013  # WebSocket's status for "try again later"
_HEADERS = {
    # It may stand in a frame of any page, as Cockpit's; it asks nobody but this server for anything.
    "Content-Security-Policy": "default-src 'self'; connect-src 'self' ws: wss:; frame-ancestors *; base-uri 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-cache",
}


@dataclass(frozen=True)
class Served:
    """What pages get: a board, and the marks as GeoJSON; and who does, or counts as refused, what they ask for."""

    board: Board
    chart: Callable[[], bytes]
    ask: Callable[[MarkRequest], None]
    refuse: Callable[[RefusedInput], None]


class PageServer:
    """Listens from the beginning; `port` is the one that it found."""

    def __init__(self, served: Served, parameters: WebPageParameters, folder: Path) -> None:
        """`folder`: of the page's files. Raises OSError where address or port cannot be had."""
        sockets = bind_sockets(parameters.port, parameters.host)
        for one in sockets:
            one.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)
        self.port = sockets[0].getsockname()[1]
        shared = {"served": served, "parameters": parameters}
        routes = [
            ("/live", _Live, {**shared, "opened": set()}),
            ("/marks.geojson", _Chart, shared),
            ("/(.*)", _File, {"path": str(folder), "default_filename": "index.html"}),
        ]
        settings = {
            "websocket_ping_interval": _PING, "websocket_ping_timeout": _PONG, "compress_response": True,
            "websocket_max_message_size": LONGEST_REQUEST, "log_function": lambda _handler: None,
        }  # fmt: skip
        threading.Thread(target=self._serve, args=(Application(routes, **settings), sockets), daemon=True).start()

    def _serve(self, application: Application, sockets: Any) -> None:
        asyncio.set_event_loop(asyncio.new_event_loop())
        limits = {"max_header_size": _LARGEST_HEADER, "max_body_size": LONGEST_REQUEST, "idle_connection_timeout": 60.0}
        HTTPServer(application, **limits).add_sockets(sockets)
        IOLoop.current().start()


class _File(StaticFileHandler):
    """A file of the page; tornado gives none from outside of its folder."""

    def set_extra_headers(self, path: str) -> None:
        for name, value in _HEADERS.items():
            self.set_header(name, value)


class _Chart(RequestHandler):
    """The marks as a file to download."""

    def initialize(self, served: Served, parameters: WebPageParameters) -> None:
        self._served = served

    def get(self) -> None:
        for name, value in {**_HEADERS, "Content-Type": "application/geo+json"}.items():
            self.set_header(name, value)
        self.set_header("Content-Disposition", 'attachment; filename="marks.geojson"')
        self.finish(self._served.chart())


class _Live(WebSocketHandler):
    """One page that is open: gets what is new as fast as it takes it, and may set marks."""

    def initialize(self, served: Served, parameters: WebPageParameters, opened: Set["_Live"]) -> None:
        self._served, self._parameters, self._opened = served, parameters, opened
        self._queue = ThinQueue(parameters.bytes_per_second)
        self._is_fed, self._next_request = False, 0.0

    def get_compression_options(self) -> dict:
        """Let messages be compressed, at little cost."""
        return {"compression_level": 3, "mem_level": 5}

    def open(self, *_: Any) -> None:
        self.set_nodelay(True)
        self._opened.add(self)
        if len(self._opened) > self._parameters.most_pages:
            self.close(_TOO_MANY, f"{self._parameters.most_pages} pages are open, which is most_pages")

    async def on_message(self, message: Any) -> None:
        """Take a request."""
        try:
            request = parsed(message)
            if isinstance(request, Hello):
                await self._feed(request)
            else:
                self._pace()
                self._served.ask(request)
        except RefusedInput as refused:
            self._served.refuse(refused)
            await self._send(text_of(refused=str(refused)))

    def _pace(self) -> None:
        now = time.monotonic()
        if now < self._next_request:
            raise RefusedInput("requests refused", f"more than one in {_REQUEST_PERIOD:g} s from one page")
        self._next_request = now + _REQUEST_PERIOD

    async def _feed(self, hello: Hello) -> None:
        """Begin to send what is new since the page was here last."""
        board = self._served.board
        if self._is_fed:
            raise RefusedInput("requests refused", "a second hello of one page")
        self._is_fed = True
        with board.lock:
            board.open(self._queue, hello.revision if hello.run == board.run else 0)
        IOLoop.current().spawn_callback(self._send_on)

    async def _send_on(self) -> None:
        """Send until the page is gone. A slow link makes this wait, and meanwhile newer items replace older ones."""
        board, told = self._served.board, -1
        while self.ws_connection is not None:
            with board.lock:
                items, revision = self._queue.take(time.monotonic()), board.revision
                is_whole = not self._queue.waiting_bytes
            for one in items:
                await self._send(one.item)
            if is_whole and revision != told:
                told = revision
                await self._send(text_of(revision=revision))
            await asyncio.sleep(_PERIOD)
        board.close(self._queue)

    async def _send(self, item: Any) -> None:
        try:
            await self.write_message(item, binary=isinstance(item, bytes))
        except (WebSocketClosedError, StreamClosedError):
            self._served.board.close(self._queue)

    def on_close(self) -> None:
        self._opened.discard(self)
        self._served.board.close(self._queue)

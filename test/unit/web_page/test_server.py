"""The server over a real socket: files, marks, limits, and who may look."""

import asyncio
import json
from http.client import HTTPConnection

import pytest
from tornado.httpclient import HTTPClientError, HTTPRequest
from tornado.websocket import websocket_connect

from node_support.errors import RefusedInput
from node_support.files import package_folder
from node_support.marks import Mark
from web_page.board import WORDS, Board
from web_page.parameters import WebPageParameters
from web_page.server import PageServer, Served

HELLO = '{"hello": {"run": "r", "revision": 0}}'


class _Site:
    def __init__(self, **parameters):
        self.board, self.asked, self.refused = Board(), [], []
        self.board.run = "r"
        served = Served(self.board, lambda: b"{}", self.asked.append, self.refused.append)
        self.server = PageServer(served, WebPageParameters(port=0, **parameters), package_folder() / "web")

    def get(self, path, method="GET", body=None):
        connection = HTTPConnection("127.0.0.1", self.server.port, timeout=20)
        connection.request(method, path, body)
        answer = connection.getresponse()
        return answer, answer.read()

    def talk(self, *messages, wanted=1, **headers):
        """Send messages of one page, and return the first texts that come."""

        async def run():
            request = HTTPRequest(f"ws://127.0.0.1:{self.server.port}/live", headers=headers)
            page = await websocket_connect(request)
            for message in messages:
                page.write_message(message)
            return [await asyncio.wait_for(page.read_message(), 20) for _ in range(wanted)]

        return asyncio.run(run())


@pytest.fixture(scope="module")
def site():
    return _Site()


def test_the_page_comes_and_may_stand_in_a_frame(site):
    answer, page = site.get("/")
    assert (answer.status, b"<!doctype html>" in page) == (200, True)
    assert "X-Frame-Options" not in answer.headers
    assert "default-src 'self'" in answer.headers["Content-Security-Policy"]


@pytest.mark.parametrize("path", ["/../setup.py", "/..%2fsetup.py", "/%2e%2e/setup.py", "//etc/passwd", "/nothing"])
def test_no_file_from_outside_of_its_folder_is_given(site, path):
    answer, content = site.get(path)
    assert answer.status in (403, 404)
    assert b"underwater" not in content


def test_nothing_can_be_posted(site):
    assert site.get("/", "POST", b"x")[0].status == 405
    try:
        status = site.get("/", "POST", b"x" * 10_000)[0].status
    except ConnectionError:
        # It does not read a long message to its end, and closes the connection: the answer may be lost.
        return
    assert status in (400, 405, 413)


def test_a_page_gets_what_is_new_and_may_set_a_mark(site):
    site.board.put("words", '{"words":1}', WORDS)
    assert site.talk(HELLO) == ['{"words":1}']
    site.talk('{"mark": {"name": "block", "x": 1, "y": 2}}', "{}")
    assert site.asked == [Mark("block", 1, 2)]


def test_a_page_that_asks_without_end_is_held_up(site):
    site.asked.clear()
    (refused,) = site.talk(*['{"delete": {"name": "block"}}'] * 200)
    assert "more than one" in json.loads(refused)["refused"]
    assert 0 < len(site.asked) < 200


def test_what_is_no_request_is_refused_and_counted(site):
    assert "must be hello, mark or delete" in json.loads(site.talk('{"drive": {}}')[0])["refused"]
    assert isinstance(site.refused[-1], RefusedInput)


def test_a_message_that_is_too_long_ends_the_connection(site):
    assert site.talk("x" * 100_000) == [None]


def test_pages_of_other_sites_get_nothing(site):
    with pytest.raises(HTTPClientError, match="403"):
        site.talk(HELLO, Origin="http://elsewhere.example")


def test_no_more_pages_than_allowed_are_open():
    site = _Site(most_pages=1)

    async def run():
        url = f"ws://127.0.0.1:{site.server.port}/live"
        first = await websocket_connect(url)
        first.write_message(HELLO)
        await asyncio.wait_for(first.read_message(), 20)
        second = await websocket_connect(url)
        return await asyncio.wait_for(second.read_message(), 20), second.close_reason

    message, reason = asyncio.run(run())
    assert (message, reason) == (None, "1 pages are open, which is most_pages")


def test_a_port_that_is_taken_is_told(site):
    with pytest.raises(OSError, match="in use"):
        PageServer(None, WebPageParameters(port=site.server.port), package_folder() / "web")

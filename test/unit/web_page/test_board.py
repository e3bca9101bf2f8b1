"""Of each thing a page gets the newest, and after a cut link what changed meanwhile."""

import pytest

from node_support.thin_queue import ThinQueue
from web_page.board import TILE, Board


@pytest.fixture
def board():
    return Board()


@pytest.fixture
def page(board):
    return _opened(board)


def _opened(board, since=0):
    page = ThinQueue(1e6)
    board.open(page, since)
    return page


def _items(page):
    return [one.item for one in page.take(0.0)]


def test_a_page_gets_all_that_is_there(board):
    board.put("a", b"1", TILE)
    board.put("b", b"2", TILE)
    assert sorted(_items(_opened(board))) == [b"1", b"2"]


def test_a_slow_page_gets_the_newest_of_each_thing_only(board, page):
    for number in range(100):
        board.put("a", b"%d" % number, TILE)
    assert _items(page) == [b"99"]


def test_a_page_that_comes_again_gets_what_changed_since(board):
    board.put("a", b"1", TILE)
    board.put("b", b"2", TILE)
    seen = board.revision
    board.put("a", b"3", TILE)
    assert _items(_opened(board, seen)) == [b"3"]


def test_what_does_not_change_is_not_sent_again(board, page):
    board.put("a", b"1", TILE)
    _items(page)
    board.put("a", b"1", TILE)
    assert _items(page) == []


def test_another_run_leaves_nothing_of_the_one_before(board, page):
    board.put("a", b"1", TILE)
    board.clear()
    assert _items(page) == []
    assert _items(_opened(board)) == []


def test_a_page_that_has_gone_gets_nothing(board, page):
    board.close(page)
    board.put("a", b"1", TILE)
    assert (_items(page), board.pages) == ([], 0)

import pytest
from ping360_fault_experiment import run

from ping360_driver.emulator import Ping360FaultRates
from ping360_driver.protocol.scan_command import ScanMode
from sonar_driver.emulator import Fault


@pytest.fixture(scope="module", params=ScanMode, ids=[mode.value for mode in ScanMode])
def account(request, tmp_path_factory):
    port = str(tmp_path_factory.mktemp("line") / "sonar")
    return run(port, request.param, commands=50, rate=0.06, seed=3)


def test_the_experiment_met_every_fault(account):
    assert set(account.faults) == {Fault.NONE, *Ping360FaultRates.known()}


def test_with_every_fault_each_good_reply_is_delivered_once_and_in_order(account):
    assert account.delivered == sorted(set(account.delivered))
    assert [number for number in account.delivered if number not in account.optional] == account.expected


def test_with_every_fault_each_bad_reply_is_counted(account):
    """While the head scans by itself, two broken messages in a row may look like one."""
    faults, stats = account.faults, account.stats
    spoilt = faults[Fault.GARBLED] + faults[Fault.TRUNCATED]
    assert stats.bad_frames in ([spoilt] if stats.mode == "request" else [spoilt, spoilt - 1])
    assert stats.unexpected_replies >= faults[Fault.DOUBLED]
    assert stats.refusals == faults[Fault.REFUSED]
    assert stats.pings == stats.replies + stats.timeouts + stats.bad_frames + stats.refusals + stats.interrupted

"""Notices that the ROS master does not know this node any more, as after a restart of the master."""

import threading
import time
import xmlrpc.client

import rosgraph
import rospy

PERIOD = 2.0  # s: soon enough for a respawn, seldom enough to cost nothing
_ENOUGH = 2  # answers in a row: the first one may come while the node itself registers
_SUCCESS = 1  # status of the XML-RPC interface of ROS; others mean that the node is unknown


class MasterWatch:
    """Asks the master every `PERIOD` seconds whether it knows this node.

    A master that gives no answer may only be away for a while, and the node runs on. A new master, which answers that
    it does not know the node, has neither its topics nor its parameters: nobody will ever connect to the node again.
    """

    def __init__(self) -> None:
        """Begin to watch; the node has to be initialised."""
        self.is_lost = False
        self._master = xmlrpc.client.ServerProxy(rosgraph.get_master_uri())
        threading.Thread(target=self._watch, daemon=True).start()

    def _watch(self) -> None:
        unknown = 0
        while unknown < _ENOUGH:
            time.sleep(PERIOD)
            unknown = unknown + 1 if self._does_not_know_us() else 0
        self.is_lost = True

    def _does_not_know_us(self) -> bool:
        try:
            status, _, uri = self._master.lookupNode(rospy.get_name(), rospy.get_name())
        except (OSError, xmlrpc.client.Error):
            return False
        return status != _SUCCESS or uri != rospy.get_node_uri()

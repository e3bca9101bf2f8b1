"""What map_bag leaves in its folder."""

from made_blocks import *  # noqa: F403

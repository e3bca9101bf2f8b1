"""The Ping360's side of Blue Robotics' ping protocol: bytes to frozen dataclasses and back, without input or output."""

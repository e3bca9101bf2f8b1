"""Where the map lies on the Earth, and the files of charts."""

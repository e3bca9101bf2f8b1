"""The line to a Ping360: messages and the times of their arrival, scans by the head and by request, counts."""

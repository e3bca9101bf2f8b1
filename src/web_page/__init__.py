"""A page that shows map, vehicle and sonar in any browser, live, over a link of few bytes a second."""

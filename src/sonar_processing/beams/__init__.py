"""One beam: messages of any sonar in, what it holds, where it was sent, and where its bins lie."""

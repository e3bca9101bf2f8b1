"""One beam: what it holds, where it was sent, and where its bins lie."""

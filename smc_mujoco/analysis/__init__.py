"""One question, answered by many runs."""

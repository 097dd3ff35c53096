"""The audit of papers: claims as data, a function that measures each, and their verdicts."""

"""Many questions, whose answers are kept."""

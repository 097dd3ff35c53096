"""Commands of the command line: plain functions that `cli` registers, light to import."""

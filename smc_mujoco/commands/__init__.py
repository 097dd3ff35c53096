"""Commands of the command line, one a file: plain functions that `cli` registers, light to import."""

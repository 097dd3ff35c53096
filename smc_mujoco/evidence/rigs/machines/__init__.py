"""The rigs, one file each: numbers with their sources, and how they make a machine."""

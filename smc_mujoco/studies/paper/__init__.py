"""The study that ships: one paper, its plants and its claims."""

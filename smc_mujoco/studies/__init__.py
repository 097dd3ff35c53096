"""Studies: grids of runs with stored results, and what is made of them."""

"""Physics without a controller: plants, and what makes them real."""

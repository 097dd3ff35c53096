"""Physics without a controller: plants, and the parts that make them real."""

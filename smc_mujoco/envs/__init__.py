"""Plants as environments of agents."""

"""What the audits in benchmarks/papers share."""

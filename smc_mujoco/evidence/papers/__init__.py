"""What the audits in benchmarks/papers share, and the study of Gaber's paper."""

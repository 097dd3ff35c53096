"""Functions without a simulator: laws, surfaces, estimators, policies."""

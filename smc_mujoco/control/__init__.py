"""Functions without a simulator: laws, surfaces, estimators; and sets of gains."""

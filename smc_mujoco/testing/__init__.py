"""What the pytest plugin is made of: step responses, limits, golden metrics, cases of the study, reports."""

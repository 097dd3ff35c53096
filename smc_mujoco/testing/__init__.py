"""The pytest plugin: step responses, limits on metrics, golden metrics, cases of the study, reports
of failures.
"""

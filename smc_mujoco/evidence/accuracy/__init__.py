"""Accuracy: how the error of a law falls with the control period, beside the order that theory
promises.
"""

"""Synthetic data and the shipped example."""

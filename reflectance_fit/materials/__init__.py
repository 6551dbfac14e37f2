"""Cited optical constants, and the loader of refractiveindex.info files."""

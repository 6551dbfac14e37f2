"""Diagnostic plots; the only home of matplotlib."""

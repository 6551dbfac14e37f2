"""Photographs in: raw files read, decoded and reduced."""

"""Optical constants of every pixel: many small fits at once, each equal to the fit of the same readings alone."""

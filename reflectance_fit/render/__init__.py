"""A path tracer on the CPU: scenes with exact Fresnel, spectra and polarization, as far as a scene needs them."""

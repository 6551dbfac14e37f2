"""From Observations to eta, k and their posterior."""

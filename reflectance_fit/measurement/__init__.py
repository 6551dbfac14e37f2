"""Tables that exist already, read into Observations."""

"""The transport, over blocks of rays held in small arrays (docs/decisions/0010)."""

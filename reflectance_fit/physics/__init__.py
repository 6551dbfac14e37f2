"""Reflection at one interface: pure functions on arrays, signs of docs/conventions.md."""

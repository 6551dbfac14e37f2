"""The command line: one verb, one file.

Imports within are relative: type checkers know this folder as ``cli``.
"""

"""What happens to a ray at a surface: functions of one lane, in arithmetic that a compiler turns into vectors.

Arguments and results are numbers of one type, float32 or float64; nothing
branches, and nothing is called that has no vector instruction.
"""

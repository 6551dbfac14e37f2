"""The result as files: report.yaml and what it needs."""

"""Datasets in the formats of others: `formats/<name>.py` writes one format, found by its name."""

"""The parts of the report: markup, pictures, plots, and one file per group of sections."""

"""Pose from points, on problems that are made while the benchmark runs: layouts, places, noise; no image."""

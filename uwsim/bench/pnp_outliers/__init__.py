"""Pose from points with outliers among them, on problems with known answers."""

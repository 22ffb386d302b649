"""The results page of the motion-blur benchmarks: README.md, figures and JSON in one folder."""

"""The results page of the pose benchmark on rendered pictures: README.md, a figure and JSON in one folder."""

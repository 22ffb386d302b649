"""The results page of the pose benchmark on made problems: README.md, figures and JSON in one folder."""

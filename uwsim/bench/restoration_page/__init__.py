"""The results page of the restoration benchmark: README.md, figures, contact sheets and JSON in one folder."""

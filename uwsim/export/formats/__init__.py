"""One file per format: `export(dataset, folder, *, splits, progress)` fills an empty folder and returns one line.

`dataset`: a `dataset.store.Dataset`; `splits`: {frame name: name of its split}, see `uwsim.export.splits`;
`progress(text, done, total)`. `SPLITS = False` says that the format has none (then every frame is in one).
"""

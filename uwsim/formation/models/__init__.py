"""One imaging model per file: `layers(view, **parameters)` -> layers; `PARAMETERS`: what may be fitted to a picture."""

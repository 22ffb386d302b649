"""A static page to look through a dataset: contact sheet, every layer of every frame, poses and blur drawn."""

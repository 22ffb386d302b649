"""uwsim: a physics-based underwater image simulator and benchmark."""

__version__ = "0.1.0"

"""What every test shares: the libLLVM is chosen before any of them can import mitsuba."""

import os

from uwsim.render import llvm

# no test opens a window
os.environ.setdefault("MPLBACKEND", "Agg")
llvm.prepare()

"""Where imaging models hold: models of `uwsim/formation` against rendered frames."""

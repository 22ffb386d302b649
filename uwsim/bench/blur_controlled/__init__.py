"""Motion blur on frames that are made while the benchmark runs: textures, straight uniform blur, noise, 8 bits."""

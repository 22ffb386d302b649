"""Maximum-likelihood fit of blur, texture and noise to the power spectrum of a picture (Whittle's likelihood)."""

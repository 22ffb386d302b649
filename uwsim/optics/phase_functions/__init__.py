"""Phase functions: one file each, all with the same five questions.

`density(angle_rad)` [1/sr] (integral over the sphere = 1), `cdf(angle_rad)` (share scattered to smaller angles),
`sample(uniform)` -> angle [rad], `mean_cosine`, `backscatter_fraction` (share beyond 90 deg).

Inside, everything is written in s = sin^2(angle / 2): d(solid angle) = 4 pi ds, the share scattered below s is
4 pi int_0^s p ds, cos(angle) = 1 - 2 s. Unlike 1 - cos it keeps its digits at small angles, also in float32.
"""

"""`uwsim bench restoration --photos DIR`: methods on real photographs and videos, of which nobody knows the truth.

Photographs: scores that see the picture alone, and PSNR and SSIM against a pseudo-reference, which ranks methods but
measures no physics. Videos of tags on a plane whose layout is known: how many tags the next stage can use, and how
well their corners lie.
"""

"""Every physics test renders in llvm_ad_spectral."""

import pytest


@pytest.fixture(scope="session")
def llvm_spectral():
    from uwsim.render import variants

    return variants.use("llvm_ad_spectral")

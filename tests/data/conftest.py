import pytest

from nbv.data.render import open_renderer


@pytest.fixture(scope="session")
def embree():
    return open_renderer("embree")

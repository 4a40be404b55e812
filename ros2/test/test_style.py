"""Check the style of this package with ROS 2's linters, as they are configured by default."""

from ament_flake8.main import main_with_errors
from ament_pep257.main import main
import pytest

pytestmark = pytest.mark.linter


def test_flake8():
    failed, errors = main_with_errors(argv=[])
    assert not failed, '\n'.join(errors)


def test_pep257():
    assert main(argv=[]) == 0

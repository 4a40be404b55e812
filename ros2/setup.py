"""Install `upright_ros` with colcon; the nodes themselves are in `upright.nodes`."""

from glob import glob
from xml.etree import ElementTree

from setuptools import setup

package = ElementTree.parse('package.xml').getroot()
name = package.findtext('name')
share = f'share/{name}'

setup(
    name=name,
    version=package.findtext('version'),
    description=' '.join(package.findtext('description').split()),
    license=package.findtext('license'),
    packages=[name],
    install_requires=['upright'],
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{name}']),
        (share, ['package.xml']),
        *((f'{share}/{folder}', glob(f'{folder}/*.*')) for folder in ('launch', 'config', 'rviz')),
    ],
    entry_points={
        'console_scripts': [
            f'{node} = {name}.programs:{node}' for node in ('simulator', 'learner')
        ]
    },
    extras_require={'test': ['pytest']},  # what colcon tests with
)

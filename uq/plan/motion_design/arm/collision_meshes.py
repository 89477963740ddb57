"""The shapes of a URDF's links that must not touch, with the files of their meshes found as ROS finds them."""

import math
import os
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import unquote
from xml.etree import ElementTree

from rig.exceptions import quoted
from uq.experiment.arm_table import DeclaredArm
from uq.files.mistakes import ExperimentError
from uq.runs.recorded.urdf_model import urdf_robot

PACKAGE = ("package://", "model://")
FORMATS = (".stl", ".obj", ".msh")
"""File formats of meshes that MuJoCo reads."""


def with_mesh_files(arm: DeclaredArm) -> ElementTree.Element:
    """Return the robot of an arm's URDF without what is only looked at, the meshes of its collision shapes as paths.

    Raises:
        ExperimentError: there is no such file, it is no XML, it holds too much, a mesh has no file that can be read, or
            a shape has a number that is not finite.
    """
    urdf, robot = arm.urdf, urdf_robot(arm.urdf, "platform.urdf", arm.fixed)
    for link in robot.iter("link"):
        for seen in link.findall("visual"):
            link.remove(seen)
        for shape in link.findall("collision"):
            _check_numbers(shape, f"link {quoted(link.get('name', ''))} in {Path(urdf).name}")
        for mesh in link.iter("mesh"):
            file = _file(mesh.get("filename", ""), Path(urdf))
            if file.suffix.lower() not in FORMATS:
                raise ExperimentError(
                    f"collision mesh {quoted(file.name)} of {Path(urdf).name} is none of {', '.join(FORMATS)}: convert "
                    "it to binary STL and name that, or use boxes, cylinders and spheres"
                )
            mesh.set("filename", str(file))
    return robot


def _check_numbers(shape: ElementTree.Element, owner: str) -> None:
    """Refuse numbers that are not finite, which MuJoCo takes for a place."""
    for element in shape.iter():
        for key in ("xyz", "rpy", "scale", "size", "radius", "length"):
            text = element.get(key, "0")
            if not all(math.isfinite(_number(word)) for word in text.split()):
                raise ExperimentError(f"{key}={quoted(text)} of a collision shape of {owner}: write finite numbers")


def _number(word: str) -> float:
    try:
        return float(word)
    except ValueError:
        return math.nan


def _file(name: str, urdf: Path) -> Path:
    """The file of a mesh."""
    scheme = next((scheme for scheme in PACKAGE if name.startswith(scheme)), None)
    if scheme is None:
        path = urdf.parent / unquote(name.removeprefix("file://")) if name.startswith("file://") else urdf.parent / name
        if name and path.is_file():
            return path.absolute()
        cure = "put it there"
    else:
        package, _, rest = name.removeprefix(scheme).partition("/")
        for folder in _packages(package, urdf):
            if package and rest and (folder / rest).is_file():
                return folder / rest
        cure = f"name the folder that holds {package or 'the package'} in ROS_PACKAGE_PATH"
    raise ExperimentError(
        f"no file of the collision mesh {quoted(name)} in {urdf.name}: {cure}, or use boxes, cylinders and spheres"
    )


def _packages(package: str, urdf: Path) -> Iterator[Path]:
    """Folders that a package of ROS may be: by the environment, else above or beside the URDF."""
    for text in filter(None, os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep)):
        folder = Path(text).absolute()
        yield from (folder / package, *([folder] if folder.name == package else []))
    for text in filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)):
        yield Path(text).absolute() / "share" / package
    above = urdf.absolute().parents
    yield from (folder for folder in above if folder.name == package)
    yield above[0] / package

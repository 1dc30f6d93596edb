"""Depth sensors, which convert true depth to measured depth.

A sensor is a class whose fields are its parameters; an instance maps the depth images of an object
to measured images. The configuration names a sensor, and only that one is imported. `IDEAL` stands
for true depth.

A sensor needs the size of the object in metres: `diagonal_m` is the diagonal of its bounding box,
the unit of all depths. The camera's distance in diagonals scales with the object. Its image is a
part of the sensor's image, resized by nearest neighbours: an angle covers ``camera.focal_px /
sensor.focal_px`` times as many pixels.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields
from importlib import import_module
from typing import Any, Protocol

import numpy as np

from nbv.core.seeds import rng_for
from nbv.data.camera import Camera
from nbv.data.depth_codes import Depths
from nbv.errors import UserError, nearest

IDEAL = "ideal"
SENSORS: Mapping[str, str] = {
    "kinect": "nbv.data.sensors.triangulation:Kinect",
    "stereo": "nbv.data.sensors.triangulation:Stereo",
}

Measure = Callable[[Depths, str], Depths]
"""A function from the depth images of an object and its id to the measured images."""


class Sensor(Protocol):
    """The interface of a noisy sensor."""

    @property
    def nearest_m(self) -> float:
        """The shortest measurable distance, in metres."""
        ...

    def __call__(
        self, depth: Depths, camera: Camera, diagonal_m: float, rng: np.random.Generator
    ) -> Depths:
        """Measure the depth images of an object.

        Parameters
        ----------
        depth : (k, side, side) float32
            Distance along the optical axis, in object diagonals; 0 for background.
        camera : Camera
            Its ``focal_px`` gives the size of a pixel. The sensor's optical axis is assumed to pass
            through the middle of the image.
        diagonal_m : float
            Metres per object diagonal.
        rng : numpy.random.Generator
            A generator for this object alone.

        Returns
        -------
        (k, side, side) float32
            Object diagonals; 0 without a measurement.
        """
        ...


def sensor_settings(sensor: Mapping[str, Any], category: str, seed: int) -> dict[str, Any]:
    """Return the settings of ``sensor`` for the images of a category, which `open_sensor` takes.

    The sensor's ``diagonal_m`` has an entry for each category, unless it is `IDEAL`.

    Raises
    ------
    UserError
        If the size of the category is missing and the sensor needs it.
    """
    if sensor["name"] == IDEAL:
        return {"name": IDEAL}
    if category not in sensor["diagonal_m"]:
        raise UserError(
            f"sensor.diagonal_m.{category}: sensor={sensor['name']} needs the size of every "
            "category in metres (the bounding box's diagonal); add it"
        )
    return {
        "name": sensor["name"],
        "parameters": sensor["parameters"],
        "diagonal_m": sensor["diagonal_m"][category],
        "seed": seed,
    }


def check_sensor(sensor: Mapping[str, Any], categories: Iterable[str]) -> None:
    """Raise UserError if the configuration's ``sensor`` cannot be used for a category."""
    for category in categories:
        settings = sensor_settings(sensor, category, 0)
        if settings["name"] != IDEAL:
            build_sensor(settings["name"], settings["parameters"])


def open_sensor(settings: Mapping[str, Any], camera: Camera, *labels: str | int) -> Measure | None:
    """Return a sensor for the objects of a category at an elevation, or None for `IDEAL`.

    Parameters
    ----------
    settings : mapping
        The settings of `sensor_settings`.
    *labels : str or int
        Category and elevation. With the seed and an object's id they determine its noise, which
        does not depend on other objects.

    Raises
    ------
    UserError
        For an unknown sensor or parameter, or if the object is too near to be measured.
    """
    name = settings["name"]
    if name == IDEAL:
        return None
    sensor, diagonal_m = build_sensor(name, settings["parameters"]), settings["diagonal_m"]
    distance_m = camera.distance * diagonal_m
    if distance_m < sensor.nearest_m:
        raise UserError(
            f"sensor.diagonal_m={diagonal_m:g} puts the camera {distance_m:.2f} m from the object, "
            f"and {name} measures nothing nearer than {sensor.nearest_m:.2f} m: raise it, or "
            f"camera.distance={camera.distance:g}"
        )

    def measure(depth: Depths, object_id: str) -> Depths:
        rng = rng_for(settings["seed"], "sensor", *labels, object_id)
        return sensor(depth, camera, diagonal_m, rng)

    return measure


def build_sensor(name: str, parameters: Mapping[str, float]) -> Sensor:
    """Return a sensor by name.

    Raises
    ------
    UserError
        For an unknown sensor, or a parameter that is unknown or missing.
    """
    if name not in SENSORS:
        raise UserError(f"sensor={name} is unknown: {nearest(name, [IDEAL, *SENSORS])}")
    module, _, attribute = SENSORS[name].partition(":")
    kind = getattr(import_module(module), attribute)
    known = [field.name for field in fields(kind)]
    for key in parameters:
        if key not in known:
            raise UserError(
                f"sensor.parameters.{key}: {name} has no such parameter; {nearest(key, known)}"
            )
    absent = [key for key in known if key not in parameters]
    if absent:
        raise UserError(f"sensor.parameters.{absent[0]}: {name} needs it; add it")
    sensor: Sensor = kind(**parameters)
    return sensor

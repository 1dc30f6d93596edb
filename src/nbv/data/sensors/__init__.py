"""Depth sensors: they turn true depth into measured depth.

A sensor is a class in a file of its own. Its fields are its parameters, and an instance maps the
depth images of one object to what the sensor measures. The configuration names a sensor, and only
that one is imported: an edit of one sensor renders no image of another again. `IDEAL` is the name
of no sensor.

A sensor has a size and a resolution, so the object needs a size in metres: `diagonal_m` is the
diagonal of its bounding box, the unit of all depths. The camera's distance, in diagonals, scales
with the object. Its image is a part of the sensor's image, resized to the nearest value: an angle
covers ``camera.focal_px / focal_px of the sensor`` times as many pixels.
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
"""From the depth images of one object and its id to the measured images."""


class Sensor(Protocol):
    """The interface of a noisy sensor."""

    @property
    def nearest_m(self) -> float:
        """The shortest distance that it can measure, in metres."""
        ...

    def __call__(
        self, depth: Depths, camera: Camera, diagonal_m: float, rng: np.random.Generator
    ) -> Depths:
        """Return what the sensor measures of one object.

        Parameters
        ----------
        depth : (k, side, side) float32
            Distance along the optical axis, in object diagonals; 0 where there is nothing.
        camera : Camera
            Its ``focal_px`` tells how many of the sensor's pixels one pixel covers. The sensor's
            optical axis is taken to pass through the middle of the image.
        diagonal_m : float
            Metres per object diagonal.
        rng : numpy.random.Generator
            Of this object alone.

        Returns
        -------
        (k, side, side) float32
            Object diagonals; 0 where nothing is measured, which may be a whole image.
        """
        ...


def sensor_settings(sensor: Mapping[str, Any], category: str, seed: int) -> dict[str, Any]:
    """Return the settings of ``sensor`` that the images of one category depend on.

    Parameters
    ----------
    sensor : mapping
        ``name, parameters, diagonal_m``, the last with an entry for each category.
    category : str
    seed : int
        The run's.

    Returns
    -------
    dict
        The argument of `open_sensor`. Without a sensor neither sizes nor seed matter.

    Raises
    ------
    UserError
        Where the category's size is missing and the sensor needs it.
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
    """Raise UserError where the configuration's ``sensor`` cannot be used for some category."""
    for category in categories:
        settings = sensor_settings(sensor, category, 0)
        if settings["name"] != IDEAL:
            build_sensor(settings["name"], settings["parameters"])


def open_sensor(settings: Mapping[str, Any], camera: Camera, *place: str | int) -> Measure | None:
    """Return a sensor for the objects of one category at one elevation, or None for `IDEAL`.

    Parameters
    ----------
    settings : mapping
        From `sensor_settings`.
    camera : Camera
    *place : str or int
        Category and elevation. Together with the seed and an object's id they determine the
        object's noise, which depends neither on other objects nor on their order.

    Raises
    ------
    UserError
        For an unknown sensor or parameter, and where the object is too near to be measured.
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
        rng = rng_for(settings["seed"], "sensor", *place, object_id)
        return sensor(depth, camera, diagonal_m, rng)

    return measure


def build_sensor(name: str, parameters: Mapping[str, float]) -> Sensor:
    """Return the sensor of a name.

    Raises
    ------
    UserError
        For an unknown sensor or parameter, or a parameter that is missing or not above 0.
    """
    if name not in SENSORS:
        raise UserError(f"sensor={name} is unknown: {nearest(name, [IDEAL, *SENSORS])}")
    module, _, attribute = SENSORS[name].partition(":")
    kind = getattr(import_module(module), attribute)
    known = [field.name for field in fields(kind)]
    for key, value in parameters.items():
        if key not in known:
            raise UserError(
                f"sensor.parameters.{key}: {name} has no such parameter; {nearest(key, known)}"
            )
        if not value > 0:
            raise UserError(f"sensor.parameters.{key}={value:g} is out of range: above 0")
    absent = [key for key in known if key not in parameters]
    if absent:
        raise UserError(f"sensor.parameters.{absent[0]}: {name} needs it; add it")
    sensor: Sensor = kind(**parameters)
    return sensor

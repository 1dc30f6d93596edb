"""Held-out estimates of many trainings in one compact file, sufficient for the statistics.

Estimates are stored as errors in hundredths of a degree. Distributions are stored for views one
class apart, relative to the true azimuth, as whole tenths of -log p. Estimates are rounded in the
same way when they are read from a run, so both sources give the same tables.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nbv.core.circle.angles import signed_difference_deg
from nbv.core.circle.distributions import in_object_frame
from nbv.core.circle.estimates import Estimates, Posteriors
from nbv.errors import UserError
from nbv.experiment.estimates import read_estimates, read_posteriors
from nbv.files import damaged, readable, write_arrays

FORMAT = 2
# The remedy in messages: a user may name any file.
_AGAIN = "name a file of kept estimates, or keep them again"
_SETTINGS = "settings"

KeptKey = tuple[int, int, str, int, int, str]
"""Shuffle, replicate, category, elevation in degrees, fold (from 1) and role."""


@dataclass(frozen=True)
class HeldOut:
    """The estimates of an estimator for held-out objects, at the precision of the file.

    Attributes
    ----------
    object_ids : tuple of str
        n objects.
    residual : ndarray (n, n_views) int16
        Estimate less truth, hundredths of a degree; view k of n_views has the azimuth
        360 k / n_views.
    surprisal : ndarray (n, B, B) uint8, optional
        −10 log p(azimuth | image), by view and by offset from the true azimuth in classes.
    """

    object_ids: tuple[str, ...]
    residual: NDArray[np.int16]
    surprisal: NDArray[np.uint8] | None = None

    @property
    def estimates(self) -> Estimates:
        """The estimates of all views, to hundredths of a degree."""
        n_views = self.residual.shape[1]
        truth = np.arange(n_views) * (360.0 / n_views)
        return Estimates(self.object_ids, np.round((truth + self.residual / 100.0) % 360.0, 2))

    @property
    def posteriors(self) -> Posteriors | None:
        """The distributions of views one class apart, or None without distributions."""
        if self.surprisal is None:
            return None
        p = np.exp(-0.1 * self.surprisal)
        rows = _in_view_frame(p / p.sum(axis=-1, keepdims=True))
        return Posteriors(self.object_ids, np.log(rows), 1.0)

    @property
    def estimates_of_posteriors(self) -> Estimates:
        """The estimates of the views in `posteriors`."""
        n_views = self.residual.shape[1]
        step = 1 if self.surprisal is None else n_views // self.surprisal.shape[1]
        return Estimates(self.object_ids, self.estimates.estimate_deg[:, ::step])


def _in_view_frame(rows: NDArray[np.floating]) -> NDArray[np.floating]:
    """Undo `nbv.core.circle.distributions.in_object_frame`."""
    bins = np.arange(rows.shape[-1])
    index = (bins - bins[:, None]) % len(bins)
    return np.take_along_axis(rows, np.broadcast_to(index, rows.shape), axis=-1)


def held_out(estimates: Estimates, posteriors: Posteriors | None = None) -> HeldOut:
    """Round estimates, and distributions of the same images, to the precision of the file.

    The number of views must be a multiple of the number of classes.
    """
    away = signed_difference_deg(estimates.estimate_deg, estimates.azimuth_deg)
    # 180° in either direction is stored as -18000.
    residual = (np.rint(away * 100.0) + 18000) % 36000 - 18000
    surprisal = None
    if posteriors is not None:
        p = posteriors.distributions
        p = p[:, :: p.shape[1] // p.shape[2]]
        # At most 138, which is −10 log of the least probability.
        surprisal = np.rint(-10.0 * np.log(in_object_frame(p))).astype(np.uint8)
    return HeldOut(estimates.object_ids, residual.astype(np.int16), surprisal)


def read_held_out(estimates: str | Path, posteriors: str | Path | None = None) -> HeldOut:
    """Read the estimates of a fold, and its distributions if `posteriors` is given.

    Same errors as `nbv.experiment.estimates.read_estimates` and
    `nbv.experiment.estimates.read_posteriors`.
    """
    read = read_estimates(estimates)
    return held_out(read, read_posteriors(posteriors, read.object_ids) if posteriors else None)


def keep_estimates(
    path: str | Path, held: Mapping[KeptKey, HeldOut], settings: Mapping[str, Any]
) -> None:
    """Write estimates with the run's configuration, `settings`."""
    arrays: dict[str, NDArray[Any]] = {
        "format": np.asarray(FORMAT),
        _SETTINGS: np.asarray(json.dumps(settings, sort_keys=True)),
    }
    for key, estimates in held.items():
        name = _name(key)
        arrays[f"{name}/objects"] = np.asarray(estimates.object_ids, dtype=np.str_)
        arrays[f"{name}/residual"] = estimates.residual
        if estimates.surprisal is not None:
            arrays[f"{name}/surprisal"] = estimates.surprisal
    write_arrays(path, arrays)


def kept_settings(path: str | Path) -> tuple[dict[str, Any], list[KeptKey]]:
    """Return the configuration in a file, and the keys of its estimates.

    Raises
    ------
    UserError
        Where the file does not hold kept estimates of this format.
    """
    with readable(path, _AGAIN), np.load(path, allow_pickle=False) as stored:
        if "format" not in stored.files or int(stored["format"]) != FORMAT:
            raise damaged(path, f"not a file of kept estimates of format {FORMAT}", _AGAIN)
        settings = json.loads(str(stored[_SETTINGS]))
        suffix = "/residual"
        names = [name.removesuffix(suffix) for name in stored.files if name.endswith(suffix)]
    return settings, [_key(name) for name in names]


def read_kept(path: str | Path, keys: Iterable[KeptKey] | None = None) -> dict[KeptKey, HeldOut]:
    """Read a file of `keep_estimates`, by default all keys.

    Raises
    ------
    UserError
        As `kept_settings` raises, and for an unknown key.
    """
    _, held = kept_settings(path)
    wanted = held if keys is None else list(keys)
    for key in wanted:
        if key not in held:
            raise UserError(f"{path}: holds no estimates of {_name(key)}; keep them again")
    kept = {}
    with readable(path, _AGAIN), np.load(path, allow_pickle=False) as stored:
        for key in wanted:
            name = _name(key)
            surprisal = f"{name}/surprisal"
            kept[key] = HeldOut(
                tuple(str(object_id) for object_id in stored[f"{name}/objects"]),
                stored[f"{name}/residual"],
                stored[surprisal] if surprisal in stored.files else None,
            )
    return kept


def join_kept(path: str | Path, parts: Iterable[str | Path]) -> None:
    """Join several files with the same settings into one.

    Raises
    ------
    UserError
        As `kept_settings` raises, and where the settings of two files differ.
    """
    held: dict[KeptKey, HeldOut] = {}
    first: dict[str, Any] | None = None
    for part in parts:
        settings, _ = kept_settings(part)
        first = settings if first is None else first
        if settings != first:
            raise UserError(f"{part}: kept with other settings than the others; keep it again")
        held |= read_kept(part)
    if first is not None:
        keep_estimates(path, held, first)


def _name(key: KeptKey) -> str:
    return "/".join(str(part) for part in key)


def _key(name: str) -> KeptKey:
    shuffle, replicate, category, elevation, fold, role = name.split("/")
    return int(shuffle), int(replicate), category, int(elevation), int(fold), role

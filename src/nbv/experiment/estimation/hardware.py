"""Device, precision and threads of torch."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from nbv.errors import UserError


@dataclass(frozen=True)
class Hardware:
    """The device and the precision of a network."""

    device: torch.device
    dtype: torch.dtype

    @contextlib.contextmanager
    def autocast(self) -> Iterator[None]:
        """Compute in `dtype` inside the block."""
        enabled = self.dtype == torch.bfloat16
        with torch.autocast(self.device.type, dtype=torch.bfloat16, enabled=enabled):
            yield

    def __str__(self) -> str:
        return f"{self.device.type}, {str(self.dtype).removeprefix('torch.')}"


def _bfloat16_is_native(device: str) -> bool:
    if device == "cuda":
        return bool(torch.cuda.is_bf16_supported(including_emulation=False))
    if device == "cpu":
        with contextlib.suppress(OSError):
            flags = Path("/proc/cpuinfo").read_text(encoding="utf-8")
            return "avx512_bf16" in flags or "amx_bf16" in flags
    return False


def choose_hardware(device: str = "auto", precision: str = "auto") -> Hardware:
    """Resolve the settings ``estimator.device`` and ``estimator.precision``.

    ``auto`` chooses CUDA, then Apple's MPS, then the CPU; and bfloat16 only where the device
    supports it natively (elsewhere it is emulated and slower than float32).

    Raises
    ------
    UserError
        For a device that this machine lacks.
    """
    present = {
        "cuda": torch.cuda.is_available(),
        "mps": torch.backends.mps.is_available(),
        "cpu": True,
    }
    if device == "auto":
        device = next(name for name, is_present in present.items() if is_present)
    elif not present[device]:
        raise UserError(f"estimator.device={device}: not available on this machine; use auto")
    if precision == "auto":
        precision = "bfloat16" if _bfloat16_is_native(device) else "float32"
    return Hardware(torch.device(device), getattr(torch, precision))


def use_one_thread() -> None:
    """Make torch compute on one thread and deterministically.

    Two jobs of two threads each on two cores ran 5 to 13 times slower than two of one thread
    each, and the result of a sum depends on the number of threads.
    """
    torch.set_num_threads(1)
    if torch.get_num_threads() != 1:
        raise RuntimeError(f"torch runs {torch.get_num_threads()} threads, not 1")
    os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")
    # The same switch as use_deterministic_algorithms(True, warn_only=True), which also imports
    # torch's compiler: two seconds a job.
    torch.set_deterministic_debug_mode("warn")
    # Filling memory that is about to be written only helps to find faults.
    torch.utils.deterministic.fill_uninitialized_memory = False  # type: ignore[attr-defined]


def to_input(codes: NDArray[np.uint8], hardware: Hardware) -> torch.Tensor:
    """Return depth codes (..., side, side) as images (n, 1, side, side) on a network's device.

    They are divided by 128, so that the background is 0 and what is visible lies around 1; exact in
    bfloat16, whose 8 significant bits hold every code.
    """
    side = codes.shape[-1]
    flat = torch.from_numpy(np.ascontiguousarray(codes).reshape(-1, 1, side, side))
    return scaled(flat.to(hardware.device), hardware)


def scaled(codes: torch.Tensor, hardware: Hardware) -> torch.Tensor:
    """Return what `to_input` does, for codes (n, 1, side, side) that lie on the device."""
    return codes.to(hardware.dtype).mul_(1 / 128).contiguous(memory_format=torch.channels_last)

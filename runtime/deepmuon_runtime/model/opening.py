"""From the contents of a model file to a session that is known to keep the contract."""

from __future__ import annotations

import math
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnxruntime

from deepmuon_runtime.errors import RefusedError, first_line
from deepmuon_runtime.model.contract import INPUT, RATE, check_signature
from deepmuon_runtime.model.device import faster_device, open_session
from deepmuon_runtime.model.family import at_depth, read_model
from deepmuon_runtime.model.metadata import RATE_DIGITS, Model, are_one_rate, is_rate
from deepmuon_runtime.model.onnx_file import check_onnx_file

__all__ = ["checked_model", "load_model", "read_file"]

LARGEST_MODEL = 2**31 - 1  # bytes: the limit of protobuf, and so of an ONNX file without external data


def read_file(path: Path) -> bytes:
    """Return the contents of a model file.

    Raises
    ------
    RefusedError
        If it is no file, too large, or can't be read.
    """
    if path.exists() and not path.is_file():
        raise RefusedError(f"{path} is no ONNX file: it is a folder, a pipe or a device")
    try:
        if path.stat().st_size > LARGEST_MODEL:
            raise RefusedError(f"{path} is no ONNX file: it is larger than 2 GB")
        return path.read_bytes()
    except (OSError, ValueError) as error:
        reason = os.strerror(error.errno) if isinstance(error, OSError) and error.errno else str(error)
        raise RefusedError(f"the model {path} can't be read: {reason}") from error


def checked_model(
    contents: bytes, name: str, depth_m: float | None = None, surface: int | None = None
) -> tuple[bytes, Model]:
    """Look through a model file before ONNX Runtime sees it, and write the wanted depth into it if it is a family.

    Parameters
    ----------
    contents
        An ONNX file.
    name
        What to call it in an error.
    depth_m, surface
        Of a family, the wanted ones, as for `at_depth`; those that stand in it if left out.

    Returns
    -------
    What is to be loaded, and the model at its depth, with the hash and size of `contents` as they were.

    Raises
    ------
    RefusedError
        If it may not be run, says of itself what can't be, or has no such depth.
    """
    check_onnx_file(contents, name)
    shipped = read_model(contents, name)
    if depth_m is None and surface is None and not shipped.is_family:
        return contents, shipped
    depth_m = shipped.depth_m if depth_m is None else depth_m
    contents = at_depth(contents, depth_m, shipped.surface if surface is None else surface, name)
    return contents, replace(read_model(contents, name), sha256=shipped.sha256, size=shipped.size)


def load_model(contents: bytes, model: Model, device: str) -> tuple[onnxruntime.InferenceSession, Model, str]:
    """Load a model that keeps the contract.

    Parameters
    ----------
    contents, model
        As `checked_model` gives them.
    device
        As for `open_session`.

    Returns
    -------
    The session, the model with the rate of its depth, and the device that it took.

    Raises
    ------
    RefusedError
        If it breaks the contract, or the device can't be had.
    """
    session, device = open_session(contents, model.name, faster_device(device, model.architecture))
    check_signature(session, model)
    return session, _with_rate(session, model), device


def _with_rate(session: onnxruntime.InferenceSession, model: Model) -> Model:
    """Return the model with the rate of its depth, which the graph gives: a family says it nowhere else."""
    if RATE not in [output.name for output in session.get_outputs()]:
        return model
    try:
        (given,) = session.run([RATE], {INPUT: np.zeros((1, model.latent_size), np.float32)})
    except Exception as error:  # ONNX Runtime's own classes have no common base
        raise RefusedError(f"{model.name} breaks the contract in a trial: {first_line(error)}") from error
    rate = float(f"{float(given[0]):.{RATE_DIGITS}g}") if given.shape == (1,) else math.nan
    if not is_rate(rate):
        raise RefusedError(
            f"{model.name} breaks the contract: its rate at {model.depth_m:g} m is {given}, and should be positive"
        )
    if model.rate_hz_per_m2 is not None:
        if not are_one_rate(rate, model.rate_hz_per_m2):
            raise RefusedError(
                f"{model.name} breaks the contract: its rate is {rate:g}, and {model.rate_hz_per_m2:g} in its metadata"
            )
        return model
    relative = model.rate_relative_uncertainty
    return replace(
        model,
        rate_hz_per_m2=rate,
        rate_uncertainty_hz_per_m2=None if relative is None else float(f"{relative * rate:.3g}"),
    )

"""`deepmuon-train export`: a trained generator as an ONNX file."""

from __future__ import annotations

from pathlib import Path

import click

__all__ = ["command"]

FILE = click.Path(path_type=Path)


@click.command(name="export")
@click.argument("generator", type=FILE)
@click.option("-o", "--output", type=FILE, metavar="FILE", required=True, help="The ONNX file to be written.")
@click.option("--overwrite", is_flag=True, help="Replace an existing file, once the new one is complete.")
@click.option("-q", "--quiet", is_flag=True, help="No closing lines.")
def command(generator: Path, output: Path, overwrite: bool, quiet: bool) -> None:
    """Write what `fit` made as an ONNX file, which deepmuon-gen --model and any ONNX runtime read.

    \b
        $ deepmuon-train export generator.pt -o model.onnx
        model.onnx: quantile, 0 m of G4_WATER, 129.03 muons per m2 and s, 106,204 bytes
        - Above 94 GeV, where the training sample thins out, the flux above E goes as E^-1.95, ...
        - Muons above 219 GeV share one distribution of angles and charges; so do those below 1.8 MeV.
        - The tables differ from the networks by 2.0e-05 of the energy (rms; at most 1.2e-04) ...
        - ONNX Runtime differs from PyTorch in double precision by at most 1.0e-06 of the energy ...

    The file keeps the project's ONNX contract: uniform random numbers in, kinetic energies, directions and charges
    out, and what is known of the training as metadata. A rate that is unknown is left out. The muons of the file are
    compared with PyTorch's before it is written. The same generator gives the same bytes.
    """  # noqa: D301 - click looks for the character \b
    from deepmuon_runtime.files.output import check_output

    check_output(output, overwrite, [generator])

    from deepmuon_training.generators.fitted import FittedGenerator, export_fitted

    fitted = FittedGenerator.load(generator)
    exported = export_fitted(fitted, output, overwrite=overwrite)
    if not quiet:
        training = fitted.training
        rate = "unknown rate" if training.rate is None else f"{training.rate:.2f} muons per m2 and s"
        click.echo(
            f"{output}: {fitted.architecture}, {training.depth_m:g} m of {training.medium}, {rate}, "
            f"{output.stat().st_size:,} bytes"
        )
        for note in exported.notes:
            click.echo(f"- {note}")

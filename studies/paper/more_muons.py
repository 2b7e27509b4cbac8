"""What a hundred million muons of CRY teach more than six million.

    python -m studies.paper.more_muons --much-cry cry_100M.h5 --held-out-cry cry_40M.h5 --work work

Both files are smoothed by maps of the first one. The generators of six million muons are the released ones, whose muons
were smoothed by maps of their own. Finished fits lie in the work folder and are not repeated.
"""

from __future__ import annotations

from pathlib import Path

import click
import torch

from deepmuon_runtime import Generator
from deepmuon_training.data.cry import read_cry
from deepmuon_training.data.smoothing import StepSmoother, smoothed
from deepmuon_training.sample import read_sample, write_sample
from studies.shared.judged import GENERATED, scores, scores_of, table
from studies.shared.options import FILE
from studies.shared.report import write
from studies.shared.trained import trained

ARCHITECTURES = ("quantile", "transformer")


@click.command(help=__doc__)
@click.option("--much-cry", required=True, type=FILE, help="CRY's muons that train.")
@click.option("--held-out-cry", required=True, type=FILE, help="Those of another run, which judge.")
@click.option("--work", required=True, type=click.Path(path_type=Path), help="Folder for samples and generators.")
def main(much_cry: Path, held_out_cry: Path, work: Path) -> None:
    """Fit the generators that are missing, and judge them beside the released ones."""
    torch.set_num_threads(1)
    work.mkdir(parents=True, exist_ok=True)
    training, testing = work / "training.h5", work / "testing.h5"
    if not (training.exists() and testing.exists()):
        smooth_both(much_cry, training, held_out_cry, testing)
    sample = read_sample(training)
    generators = {}
    for architecture in ARCHITECTURES:
        generators[architecture, "6,000,000"] = Generator.open(0, architecture=architecture)
        generators[architecture, "100,000,000"] = trained(sample, architecture, work / architecture)
    truth = read_sample(testing).muons
    results = {("CRY itself", ""): scores(sample.muons[:GENERATED], truth)}
    del sample
    results |= {key: scores_of(generator, truth) for key, generator in generators.items()}
    numbers = [{"muons_of": key[0], "learned_from": key[1], "scores": of} for key, of in results.items()]
    rows = table(("muons of", "learned from"), results)
    write(Path(__file__), {"held_out": len(truth), "generated": GENERATED, "results": numbers}, rows)


def smooth_both(much: Path, training: Path, held_out: Path, testing: Path) -> None:
    """Write both samples without CRY's steps."""
    sample = read_cry(much)
    smooth = StepSmoother(sample.muons)
    write_sample(training, smoothed(sample, smooth), overwrite=True)
    write_sample(testing, smoothed(read_cry(held_out), smooth), overwrite=True)


if __name__ == "__main__":
    main()

from __future__ import annotations

import numpy as np

from deepmuon_runtime.muons import Muons
from deepmuon_training.fluxes.ecomug import sea_level_muons
from studies.pictures.smoothing import draw_smoothing


def test_the_picture_shows_both_samples_and_their_ratio(tmp_path):
    raw = sea_level_muons(200_000, seed=1)
    moved = Muons.of(raw.kinetic_energy * np.float32(1.02), raw.u, raw.v, raw.w, raw.pdg_id)
    figure = draw_smoothing(raw, moved)
    assert [text.get_text() for text in figure.axes[1].get_legend().get_texts()] == ["CRY", "smoothed"]
    ratio = figure.axes[2].patches[0].get_data().values
    assert np.nanmax(np.abs(ratio - 1)) > 0.01
    figure.savefig(tmp_path / "smoothing.png")
    assert (tmp_path / "smoothing.png").stat().st_size > 10_000

/**
 * What the page knows of a released model: the package's manifest, and the held-out muons of its evaluation.
 *
 * @typedef {object} Model
 * @property {string} name of the file
 * @property {string} sha256
 * @property {string} architecture
 * @property {string} flux
 * @property {string} medium
 * @property {number} depth_m
 * @property {number} muons_per_draw
 * @property {number} latent_size
 * @property {number} energy_min_gev
 * @property {number} energy_max_gev
 * @property {number} rate_hz_per_m2
 * @property {Counts | null} held_out muons that it was not trained on, where it was judged by some
 *
 * @typedef {object} Counts muons in the bins of the scores: see `EnergyBins` and `CosZenithBins`
 * @property {number[]} by_energy the first below, the last above the bins
 * @property {number[]} by_cos_zenith
 *
 * @typedef {object} Released
 * @property {string} default_architecture
 * @property {Model[]} models
 */

import { fetchFile } from "./fetch_file.js";

/** @returns {Promise<Released>} */
export async function fetchReleased() {
    return (await fetchFile(new URL("models.json", import.meta.url), "the list of models")).json();
}

/**
 * Where the muons cross the plane, in words.
 *
 * @param {number} depth in metres
 */
export function place(depth) {
    return depth === 0 ? "at sea level" : `under ${depth} m of water`;
}

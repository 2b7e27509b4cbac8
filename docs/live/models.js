/**
 * What the page knows of a released model: the package's manifest, and the held-out muons of its evaluation.
 *
 * @typedef {object} Model
 * @property {string} name of the file
 * @property {string} sha256
 * @property {string} architecture
 * @property {string} flux
 * @property {string} medium
 * @property {number} surface what its muons cross, 0 for a horizontal plane
 * @property {boolean} has_sphere whether it has the muons of a sphere too
 * @property {number} depth_m of a family, the one that is chosen
 * @property {number | null} depth_min_m of a family: it has any depth from this to the next
 * @property {number | null} depth_max_m
 * @property {[number, number][] | null} rates of a family at some depths, the least first
 * @property {number} muons_per_draw
 * @property {number} latent_size
 * @property {number} energy_min_gev
 * @property {number} energy_max_gev
 * @property {number} rate_hz_per_m2
 * @property {Counts | null} held_out muons that it was not trained on, where it was judged by some
 *
 * @typedef {Model & {depth_min_m: number, depth_max_m: number, rates: [number, number][]}} Family
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

const OFFSET = 0.7; // m: spectra change with ln(depth + this) evenly

/**
 * How far along a slider a depth is.
 *
 * @param {Family} family
 * @param {number} metres
 * @returns {number} 0 to 1
 */
export function shareOfRange({ depth_min_m, depth_max_m }, metres) {
    const [least, here, most] = [depth_min_m, metres, depth_max_m].map((depth) => Math.log(depth + OFFSET));
    return (here - least) / (most - least);
}

/**
 * The depth so far along a slider, to three digits.
 *
 * @param {Family} family
 * @param {number} share 0 to 1
 */
export function depthAlong({ depth_min_m, depth_max_m }, share) {
    const [least, most] = [depth_min_m, depth_max_m].map((depth) => Math.log(depth + OFFSET));
    const metres = Number((Math.exp(least + share * (most - least)) - OFFSET).toPrecision(3));
    return Math.min(depth_max_m, Math.max(depth_min_m, Math.abs(metres) < 5e-4 ? 0 : metres));
}

/**
 * @param {Model} model
 * @returns {model is Family}
 */
export function isFamily(model) {
    return model.depth_min_m !== null;
}

/**
 * A family at a depth, with its rate there: between the depths where it is known it follows a power of depth + 0.7 m.
 *
 * @param {Family} family
 * @param {number} metres
 * @returns {Family}
 */
export function familyAt(family, metres) {
    const { rates } = family;
    const above = Math.max(
        1,
        rates.findIndex(([depth]) => depth >= metres),
    );
    const [[upper, first], [lower, second]] = rates.slice(above - 1, above + 1);
    const share = Math.log((metres + OFFSET) / (upper + OFFSET)) / Math.log((lower + OFFSET) / (upper + OFFSET));
    return { ...family, depth_m: metres, rate_hz_per_m2: first * (second / first) ** share };
}

/**
 * Where the muons cross the plane, in words.
 *
 * @param {number} depth in metres
 */
export function place(depth) {
    return depth === 0 ? "at sea level" : `under ${depth} m of water`;
}

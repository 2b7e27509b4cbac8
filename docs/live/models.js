/**
 * What the page knows of a released model: the package's manifest, and the held-out muons of its evaluation.
 *
 * @typedef {object} Model
 * @property {string} name of the file
 * @property {string} sha256
 * @property {string} architecture
 * @property {string} flux
 * @property {string} medium
 * @property {string} options of deepmuon-gen that choose flux and medium, and a space, where it would take others
 * @property {number} surface what its muons cross, 0 for a horizontal plane
 * @property {boolean} has_sphere whether it has the muons of a sphere too
 * @property {number} depth_m of a family, the one that is chosen
 * @property {number | null} depth_min_m of a family: it has any depth from this to the next
 * @property {number | null} depth_max_m
 * @property {[number, number][] | null} rates of a family at some depths, the least first
 * @property {[number, Counts][] | null} held_out_at of a family, depths at which it was judged
 * @property {number} muons_per_draw
 * @property {number} latent_size
 * @property {number} energy_min_gev
 * @property {number} energy_max_gev
 * @property {number} rate_hz_per_m2
 * @property {Counts | null} held_out muons that it was not trained on, where it was judged by some
 *
 * @typedef {Model & FamilyFields} Family
 * @typedef {{depth_min_m: number, depth_max_m: number, rates: [number, number][], held_out_at: [number, Counts][]}} FamilyFields
 *
 * @typedef {object} Counts muons in the bins of the scores: see `EnergyBins` and `CosZenithBins`
 * @property {number[]} by_energy the first below, the last above the bins
 * @property {number[]} by_cos_zenith
 *
 * @typedef {object} Released
 * @property {string} default name of the one that is taken where nothing is asked for
 * @property {Model[]} models no fixed ones whose depth a family holds
 */

import { fetchFile } from "./fetch_file.js";

/** @returns {Promise<Released>} */
export async function fetchReleased() {
    return (await fetchFile(new URL("models.json", import.meta.url), "the list of models")).json();
}

const OFFSET = 0.7; // m: spectra change with ln(depth + this) evenly
const STEPS = [1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8]; // of a key, in each power of ten
const LEAST_STEP = 0.1; // m

/** @param {number} depth in metres */
function evenly(depth) {
    return Math.log(depth + OFFSET);
}

/**
 * How far along a slider a depth is.
 *
 * @param {Family} family
 * @param {number} metres
 * @returns {number} 0 to 1
 */
export function shareOfRange({ depth_min_m, depth_max_m }, metres) {
    const [least, here, most] = [depth_min_m, metres, depth_max_m].map(evenly);
    return (here - least) / (most - least);
}

/**
 * The depth so far along a slider, to three digits, or a centimetre.
 *
 * @param {Family} family
 * @param {number} share 0 to 1
 */
export function depthAlong({ depth_min_m, depth_max_m }, share) {
    const [least, most] = [depth_min_m, depth_max_m].map(evenly);
    const metres = Math.exp(least + share * (most - least)) - OFFSET;
    const round = Math.abs(Number(metres < 1 ? metres.toFixed(2) : metres.toPrecision(3))); // of -0, too
    return Math.min(depth_max_m, Math.max(depth_min_m, round));
}

/**
 * The next round depth, as a key of the keyboard steps.
 *
 * @param {Family} family
 * @param {number} metres
 * @param {1 | -1} direction down or up
 * @param {boolean} isFar to the next power of ten
 */
export function depthBeside({ depth_min_m, depth_max_m }, metres, direction, isFar) {
    const round = [0];
    for (let power = LEAST_STEP; power < depth_max_m; power *= 10) {
        for (const step of isFar ? [1] : STEPS) round.push(Number((step * power).toPrecision(2)));
    }
    const beside = direction > 0 ? round.find((depth) => depth > metres) : round.findLast((depth) => depth < metres);
    return Math.min(depth_max_m, Math.max(depth_min_m, beside ?? direction * Infinity));
}

/**
 * Depths to be marked along a slider: both ends, and the powers of ten that have room.
 *
 * @param {Family} family
 */
export function marksAlong(family) {
    const { depth_min_m, depth_max_m } = family;
    const powers = [1, 10, 100, 1000].filter((depth) => {
        const share = shareOfRange(family, depth);
        return share > ROOM && share < 1 - ROOM_WITH_UNIT;
    });
    return [depth_min_m, ...powers, depth_max_m];
}

const ROOM = 0.09; // of a slider, for a number
const ROOM_WITH_UNIT = 0.13;

/**
 * @param {Model} model
 * @returns {model is Family}
 */
export function isFamily(model) {
    return model.depth_min_m !== null;
}

const AROUND = 4; // known rates, between which a polynomial goes

/**
 * A family at a depth, with its rate there and the muons by which it was judged there.
 *
 * @param {Family} family
 * @param {number} metres
 * @returns {Family}
 */
export function familyAt(family, metres) {
    const { rates, held_out_at } = family;
    const below = rates.findIndex(([depth]) => depth >= metres);
    const first = Math.max(0, Math.min(below - AROUND / 2, rates.length - AROUND));
    const known = rates.slice(first, first + AROUND).map(([depth, rate]) => [evenly(depth), Math.log(rate)]);
    const held_out = held_out_at.find(([depth]) => depth === metres)?.[1] ?? null;
    return { ...family, depth_m: metres, rate_hz_per_m2: Math.exp(between(known, evenly(metres))), held_out };
}

/**
 * Lagrange's polynomial through points, at a place.
 *
 * @param {number[][]} points
 * @param {number} x
 */
function between(points, x) {
    return points.reduce((sum, [at, value]) => {
        const others = points.filter(([other]) => other !== at);
        return sum + others.reduce((term, [other]) => (term * (x - other)) / (at - other), value);
    }, 0);
}

/**
 * What tells deepmuon-gen to take a model.
 *
 * @param {Model} model
 */
export function optionsOf({ options, depth_m, architecture }) {
    return `${options}--depth ${depth_m} --architecture ${architecture}`;
}

/**
 * Where the muons cross the plane, in words.
 *
 * @param {Model} model
 */
export function place({ depth_m, medium }) {
    return depth_m === 0 ? "at sea level" : `under ${depth_m} m of ${medium}`;
}

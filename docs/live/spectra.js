/** The two charts: what crosses a horizontal square metre, by energy and by zenith angle. */

import { Chart, linearAxis, logAxis, roundAxis } from "./chart.js";
import { place } from "./models.js";
import { CosZenithBins, EnergyBins } from "./tally.js";
import { periodOf } from "./words.js";

/** @typedef {import("./models.js").Model} Model */
/** @typedef {import("./models.js").Counts} Counts */
/** @typedef {{values: number[], errors: number[]}} Density */
/** @typedef {import("./chart.js").Axis} Axis */
/** @typedef {null | undefined} Nothing */

const COS_ZENITH = linearAxis("cosine of the zenith angle", 1, 0.2);
const LEAST_ENERGY = -2; // exponent, as of the bins
const DECADES = 5; // of the rate that are seen
const HIGHEST = 0.6; // E dΦ/dE in shares of the rate: no spectrum is as narrow
const SEEN_BESIDE = 100; // how many more muons there may be at sea level for its spectrum to be drawn, too

const BINS_A_DECADE = 10;
const LOG_ENERGY_WIDTH = Math.LN10 / BINS_A_DECADE;
const COS_ZENITH_WIDTH = 1 / CosZenithBins.count;
const HALF = CosZenithBins.count / 2; // the bins below cos 60°

export class Spectra {
    /**
     * @param {HTMLElement} energy
     * @param {HTMLElement} zenith
     */
    constructor(energy, zenith) {
        this.energy = new Chart(energy);
        this.zenith = new Chart(zenith);
    }

    /**
     * @param {Model} model of the muons
     * @param {Model | undefined} surface the same at sea level, for comparison
     * @param {Counts | undefined} generated none if left out
     */
    draw(model, surface, generated) {
        const { rate_hz_per_m2, held_out } = model;
        const { seconds, unit } = periodOf(rate_hz_per_m2);
        const rate = rate_hz_per_m2 * seconds;
        const above = isSeenBeside(model, surface) ? surface : undefined;
        const rateAbove = (above?.rate_hz_per_m2 ?? 0) * seconds;
        const top = Math.ceil(Math.log10(HIGHEST * Math.max(rate, rateAbove)));
        this.drawEnergy(
            place(model),
            logAxis("kinetic energy / GeV", LEAST_ENERGY, energiesTo(rate_hz_per_m2)),
            logAxis(`E dΦ/dE  /  m⁻² ${unit}`, top - DECADES, top),
            generated && energyDensity(generated, rate),
            held_out && energyDensity(held_out, rate),
            above?.held_out && energyDensity(above.held_out, rateAbove),
        );
        this.drawZenith(
            place(model),
            `dΦ/d cos θ  /  m⁻² ${unit}`,
            generated && zenithDensity(generated, rate),
            held_out && zenithDensity(held_out, rate),
        );
    }

    /**
     * @param {string} where
     * @param {Axis} x
     * @param {Axis} y
     * @param {Density | Nothing} generated
     * @param {Density | Nothing} heldOut
     * @param {Density | Nothing} surface
     */
    drawEnergy(where, x, y, generated, heldOut, surface) {
        const { edges } = EnergyBins;
        const shown = generated ?? heldOut;
        const peak = shown && Number(edges[shown.values.indexOf(Math.max(...shown.values))].toPrecision(2));
        const bins = BINS_A_DECADE * (x.ticks.length - 1);
        const within = (/** @type {number[]} */ values) => values.slice(0, bins);
        this.energy.draw({
            description: peak ? `Energy spectrum ${where}: most muons a decade near ${peak} GeV` : "No muons yet",
            x,
            y,
            steps: [
                ...(surface ? [{ name: "surface", edges, values: within(surface.values) }] : []),
                ...(generated ? [{ name: "generated", edges, values: within(generated.values) }] : []),
            ],
            points: heldOut
                ? {
                      edges,
                      values: within(heldOut.values),
                      errors: within(heldOut.errors),
                  }
                : undefined,
        });
    }

    /**
     * @param {string} where
     * @param {string} title
     * @param {Density | Nothing} generated
     * @param {Density | Nothing} heldOut
     */
    drawZenith(where, title, generated, heldOut) {
        const { edges } = CosZenithBins;
        const shown = (heldOut ?? generated)?.values ?? [1];
        const flat = (100 * sum(shown.slice(0, HALF))) / sum(shown);
        this.zenith.draw({
            description:
                `Zenith distribution ${where}: it falls from the zenith to the horizon, and ` +
                `${flat.toPrecision(2)} % come from more than 60 degrees`,
            x: COS_ZENITH,
            y: roundAxis(title, 1.05 * Math.max(...shown)),
            steps: generated ? [{ name: "generated", edges, values: generated.values }] : [],
            points: heldOut ? { edges, ...heldOut } : undefined,
        });
    }
}

/**
 * Whether a spectrum at sea level is drawn beside another: it is known, and within the same axis.
 *
 * @param {Model} model
 * @param {Model | undefined} surface
 */
export function isSeenBeside(model, surface) {
    return Boolean(surface?.held_out) && (surface?.rate_hz_per_m2 ?? 0) < SEEN_BESIDE * model.rate_hz_per_m2;
}

/**
 * Up to which power of ten of GeV energies are drawn: where fewer muons come, they are the harder ones.
 *
 * @param {number} hz muons per second and m²
 */
function energiesTo(hz) {
    return hz >= 1 ? 3 : hz >= 0.01 ? 4 : 5;
}

/** @param {Counts} counts @param {number} rate */
function energyDensity({ by_energy }, rate) {
    return density(by_energy.slice(1, -1), rate / sum(by_energy) / LOG_ENERGY_WIDTH);
}

/** @param {Counts} counts @param {number} rate */
function zenithDensity({ by_cos_zenith }, rate) {
    return density(by_cos_zenith, rate / sum(by_cos_zenith) / COS_ZENITH_WIDTH);
}

/**
 * Counts as a rate per unit of the axis, and its standard error.
 *
 * @param {number[]} counts
 * @param {number} scale
 * @returns {Density}
 */
function density(counts, scale) {
    return {
        values: counts.map((count) => scale * count),
        errors: counts.map((count) => scale * Math.sqrt(count)),
    };
}

/** @param {number[]} numbers */
function sum(numbers) {
    return numbers.reduce((total, number) => total + number, 0);
}

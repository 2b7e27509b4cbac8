/** The two charts: what crosses a horizontal square metre, by energy and by zenith angle. */

import { Chart, linearAxis, logAxis, roundAxis } from "./chart.js";
import { place } from "./models.js";
import { CosZenithBins, EnergyBins } from "./tally.js";

/** @typedef {import("./models.js").Model} Model */
/** @typedef {import("./models.js").Counts} Counts */
/** @typedef {{values: number[], errors: number[]}} Density */
/** @typedef {null | undefined} Nothing */

const ENERGY = logAxis("kinetic energy / GeV", -2, 3);
const COS_ZENITH = linearAxis("cosine of the zenith angle", 1, 0.2);
const BY_LOG_ENERGY = logAxis("E dΦ/dE  /  m⁻² s⁻¹", -3, 2);
const BY_COS_ZENITH = "dΦ/d cos θ  /  m⁻² s⁻¹";

const LOG_ENERGY_WIDTH = Math.LN10 / 10;
const COS_ZENITH_WIDTH = 1 / CosZenithBins.count;
const HALF = CosZenithBins.count / 2; // the bins below cos 60°

export class Spectra {
    /**
     * @param {HTMLElement} energy
     * @param {HTMLElement} zenith
     */
    constructor(energy, zenith) {
        this.energy = new Chart(energy, ENERGY);
        this.zenith = new Chart(zenith, COS_ZENITH);
    }

    /**
     * @param {Model} model of the muons
     * @param {Model | undefined} surface the same at sea level, for comparison
     * @param {Counts | undefined} generated none if left out
     */
    draw(model, surface, generated) {
        const rate = model.rate_hz_per_m2;
        this.drawEnergy(
            place(model.depth_m),
            generated && energyDensity(generated, rate),
            model.held_out && energyDensity(model.held_out, rate),
            surface?.held_out && energyDensity(surface.held_out, surface.rate_hz_per_m2),
        );
        this.drawZenith(
            place(model.depth_m),
            generated && zenithDensity(generated, rate),
            model.held_out && zenithDensity(model.held_out, rate),
        );
    }

    /**
     * @param {string} where
     * @param {Density | Nothing} generated
     * @param {Density | Nothing} heldOut
     * @param {Density | Nothing} surface
     */
    drawEnergy(where, generated, heldOut, surface) {
        const { edges } = EnergyBins;
        const shown = generated ?? heldOut;
        const peak = shown && edges[shown.values.indexOf(Math.max(...shown.values))].toPrecision(2);
        this.energy.draw({
            description: peak ? `Energy spectrum ${where}: most muons a decade near ${peak} GeV` : "No muons yet",
            y: BY_LOG_ENERGY,
            steps: [
                ...(surface ? [{ name: "surface", edges, values: surface.values }] : []),
                ...(generated ? [{ name: "generated", edges, values: generated.values }] : []),
            ],
            points: heldOut ? { edges, ...heldOut } : undefined,
        });
    }

    /**
     * @param {string} where
     * @param {Density | Nothing} generated
     * @param {Density | Nothing} heldOut
     */
    drawZenith(where, generated, heldOut) {
        const { edges } = CosZenithBins;
        const shown = (heldOut ?? generated)?.values ?? [1];
        const flat = (100 * sum(shown.slice(0, HALF))) / sum(shown);
        this.zenith.draw({
            description:
                `Zenith distribution ${where}: it falls from the zenith to the horizon, and ` +
                `${flat.toPrecision(2)} % come from more than 60 degrees`,
            y: roundAxis(BY_COS_ZENITH, 1.05 * Math.max(...shown)),
            steps: generated ? [{ name: "generated", edges, values: generated.values }] : [],
            points: heldOut ? { edges, ...heldOut } : undefined,
        });
    }
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

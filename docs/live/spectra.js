/** The two charts: what crosses a horizontal square metre, by energy and by zenith angle. */

import { Chart, linearAxis, logAxis, roundAxis } from "./chart.js";
import { place } from "./models.js";
import { CosZenithBins, EnergyBins } from "./tally.js";

/** @typedef {import("./models.js").Model} Model */
/** @typedef {import("./models.js").Counts} Counts */

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
        const { edges } = EnergyBins;
        const spectrum = generated && density(byEnergy(generated), model.rate_hz_per_m2, LOG_ENERGY_WIDTH);
        const held = density(byEnergy(model.held_out), model.rate_hz_per_m2, LOG_ENERGY_WIDTH);
        const above = surface && density(byEnergy(surface.held_out), surface.rate_hz_per_m2, LOG_ENERGY_WIDTH);
        const peak = edges[indexOfLargest((spectrum ?? held).values)];
        this.energy.draw({
            description: `Energy spectrum ${place(model.depth_m)}: most muons a decade near ${peak.toPrecision(2)} GeV`,
            y: BY_LOG_ENERGY,
            steps: [
                ...(above ? [{ name: "surface", edges, values: above.values }] : []),
                ...(spectrum ? [{ name: "generated", edges, values: spectrum.values }] : []),
            ],
            points: { edges, ...held },
        });
        this.drawZenith(model, generated);
    }

    /**
     * @param {Model} model
     * @param {Counts | undefined} generated
     */
    drawZenith({ depth_m, rate_hz_per_m2, held_out }, generated) {
        const { edges } = CosZenithBins;
        const distribution = generated && density(byZenith(generated), rate_hz_per_m2, COS_ZENITH_WIDTH);
        const held = density(byZenith(held_out), rate_hz_per_m2, COS_ZENITH_WIDTH);
        const flat = sum((distribution ?? held).values.slice(0, HALF)) * COS_ZENITH_WIDTH;
        this.zenith.draw({
            description:
                `Zenith distribution ${place(depth_m)}: it falls from the zenith to the horizon, and ` +
                `${((100 * flat) / rate_hz_per_m2).toPrecision(2)} % come from more than 60 degrees`,
            y: roundAxis(BY_COS_ZENITH, 1.05 * Math.max(...held.values)),
            steps: distribution ? [{ name: "generated", edges, values: distribution.values }] : [],
            points: { edges, ...held },
        });
    }
}

/** @param {Counts} counts */
function byEnergy({ by_energy }) {
    return { total: sum(by_energy), inBins: by_energy.slice(1, -1) };
}

/** @param {Counts} counts */
function byZenith({ by_cos_zenith }) {
    return { total: sum(by_cos_zenith), inBins: by_cos_zenith };
}

/**
 * Counts as a rate per unit of the axis, and its standard error.
 *
 * @param {{total: number, inBins: number[]}} counts
 * @param {number} rate of all muons
 * @param {number} width of a bin
 */
function density({ total, inBins }, rate, width) {
    const scale = rate / (total * width);
    return {
        values: inBins.map((count) => scale * count),
        errors: inBins.map((count) => scale * Math.sqrt(count)),
    };
}

/** @param {number[]} numbers */
function sum(numbers) {
    return numbers.reduce((total, number) => total + number, 0);
}

/** @param {number[]} numbers */
function indexOfLargest(numbers) {
    return numbers.indexOf(Math.max(...numbers));
}

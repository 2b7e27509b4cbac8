/** A run: so many muons of a seed, made block by block and kept until the next one. Runs in the worker. */

import { CSV_HEADER, csvLines } from "./csv.js";
import { DRAWS_STEP } from "./latents.js";
import { Tally } from "./tally.js";

const BLOCK = 1 << 15; // muons of one run of the network, about
const ARRIVALS = 256; // muons of a block that the sky is shown

/**
 * @typedef {object} Progress
 * @property {Tally} tally of all muons so far
 * @property {number} blocks made so far
 * @property {Float32Array} arrivals energy, u and v of some muons of the last block
 */

export class Run {
    /**
     * @param {import("./generator.js").Generator} generator
     * @param {number} number of muons
     * @param {bigint} seed
     */
    constructor(generator, number, seed) {
        const { muons_per_draw, energy_min_gev, energy_max_gev } = generator.model;
        this.generator = generator;
        this.number = number;
        this.seed = seed;
        this.tally = new Tally(energy_min_gev, energy_max_gev);
        this.muonsInBlock = Math.ceil(BLOCK / (muons_per_draw * DRAWS_STEP)) * muons_per_draw * DRAWS_STEP;
        /** @type {import("./tally.js").Muons[]} */
        this.blocks = [];
    }

    /**
     * Make the next block of muons.
     *
     * @returns {Promise<Progress>}
     * @throws {Error} in words, if the model fails
     */
    async more() {
        const first = this.tally.count;
        const count = Math.min(this.muonsInBlock, this.number - first);
        const muons = await this.generator.sample(this.seed, first, count);
        this.tally.add(muons);
        this.blocks.push(muons);
        return { tally: this.tally, blocks: this.blocks.length, arrivals: arrivals(muons) };
    }

    /**
     * The muons of one block as CSV, under a header if it is the first.
     *
     * @param {number} block
     */
    csv(block) {
        return new Blob([block === 0 ? CSV_HEADER : "", csvLines(this.blocks[block])], { type: "text/csv" });
    }
}

/** @param {import("./tally.js").Muons} muons */
function arrivals({ energy, direction }) {
    const some = new Float32Array(3 * Math.min(ARRIVALS, energy.length));
    for (let i = 0; i < some.length / 3; i++) {
        some.set([energy[i], direction[3 * i], direction[3 * i + 1]], 3 * i);
    }
    return some;
}

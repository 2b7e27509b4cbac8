/** Which muons of a family hit a body, and how many a second. Runs in the worker. */

import { SPHERE } from "../family.js";
import { Generator } from "../generator.js";
import { FOR_PLACES } from "../latents.js";
import { evenPoints } from "./points.js";

const POINTS = 1 << 17; // of the integral; its error is below what three digits show
const AT_ONCE = 1 << 15; // muons of one run of the network
const NOTED_DIFFERENCE = 0.05; // of the rates at the top and at the foot of a body
const NUMBERS_OF_PLACE = 3;

/**
 * Where a body ends, and how many muons come there.
 *
 * @typedef {object} End
 * @property {number} depth_m
 * @property {number} flux muons per second and m² of projected area
 */

/** Numbers of a hit: energy in GeV, direction u, v, w, and the place x, y, z in metres. */
export const NUMBERS_OF_HIT = 7;

export class Aim {
    /**
     * @param {Generator} generator of the muons of a sphere
     * @param {number} flux muons per second and m² of projected area
     * @param {Float32Array} directions of fixed points
     */
    constructor(generator, flux, directions) {
        this.generator = generator;
        this.flux = flux;
        this.directions = directions;
    }

    /**
     * @param {import("../models.js").Model} model a family at a depth
     * @throws {Error} in words
     */
    static async open(model) {
        const generator = await Generator.open({ ...model, surface: SPHERE });
        const { latent_size } = model;
        const points = evenPoints(POINTS, latent_size);
        const directions = new Float32Array(3 * POINTS);
        for (let first = 0; first < POINTS; first += AT_ONCE) {
            const some = points.subarray(first * latent_size, (first + AT_ONCE) * latent_size);
            const made = await generator.make(some);
            directions.set(made.direction, 3 * first);
        }
        const flux = await generator.rateAt(model.depth_m);
        if (!(flux > 0)) throw new Error(`The model ${model.name} does not know how many muons come.`);
        return new Aim(generator, flux, directions);
    }

    /**
     * Muons per second that hit a body: the flux times its mean shadow, by a fixed integration.
     *
     * @param {import("./bodies.js").Body} body
     */
    rate(body) {
        const { directions } = this;
        let sum = 0;
        for (let i = 0; i < directions.length; i += 3) {
            sum += body.projectedArea(directions[i], directions[i + 1], directions[i + 2]);
        }
        return (this.flux * sum) / (directions.length / 3);
    }

    /**
     * The top and the foot of a body, if what comes there differs: it gets the muons of its centre all over.
     *
     * @param {import("./bodies.js").Body} body
     * @returns {Promise<[End, End] | undefined>}
     */
    async ends({ height }) {
        const { generator } = this;
        const { depth_m, depth_min_m, depth_max_m } = /** @type {import("../models.js").Family} */ (generator.model);
        if (depth_m === 0) return undefined;
        const depths = [Math.max(depth_min_m, depth_m - height / 2), Math.min(depth_max_m, depth_m + height / 2)];
        const top = await generator.rateAt(depths[0]);
        const foot = await generator.rateAt(depths[1]);
        if (!(Math.abs(top - foot) > NOTED_DIFFERENCE * Math.min(top, foot))) return undefined;
        return [
            { depth_m: depths[0], flux: top },
            { depth_m: depths[1], flux: foot },
        ];
    }

    /**
     * The muons of a seed's first draws that hit a body at their first attempt.
     *
     * @param {import("./bodies.js").Body} body
     * @param {bigint} seed
     * @param {number} [draws]
     * @returns {Promise<Float32Array>} `NUMBERS_OF_HIT` of each
     */
    async hits(body, seed, draws = AT_ONCE) {
        const { latents, stream } = this.generator;
        const { energy, direction } = await this.generator.sample(seed, 0, draws);
        const places = latents.draw(seed, stream, 0, draws, NUMBERS_OF_PLACE, FOR_PLACES);
        const hits = new Float32Array(NUMBERS_OF_HIT * draws);
        let found = 0;
        for (let i = 0; i < draws; i++) {
            const [u, v, w] = direction.subarray(3 * i, 3 * i + 3);
            const [a, b, c] = places.subarray(3 * i, 3 * i + 3);
            const place = body.enters(u, v, w, a, b, c);
            if (place) hits.set([energy[i], u, v, w, ...place], NUMBERS_OF_HIT * found++);
        }
        return hits.slice(0, NUMBERS_OF_HIT * found);
    }
}

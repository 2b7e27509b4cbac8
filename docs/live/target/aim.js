/** Which muons of a family hit a body, and how many a second. Runs in the worker. */

import { SPHERE } from "../family.js";
import { Generator } from "../generator.js";
import { FOR_PLACES } from "../latents.js";
import { evenPoints } from "./points.js";

const POINTS = 1 << 17; // of the integral; its error is below what three digits show
const AT_ONCE = 1 << 15; // muons of one run of the network
const NUMBERS_OF_PLACE = 3;

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
        let flux = Number.NaN;
        for (let first = 0; first < POINTS; first += AT_ONCE) {
            const some = points.subarray(first * latent_size, (first + AT_ONCE) * latent_size);
            const made = await generator.make(some);
            directions.set(made.direction, 3 * first);
            flux = made.flux ?? Number.NaN;
        }
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

    /** Give its memory back. */
    async close() {
        await this.generator.close();
    }
}

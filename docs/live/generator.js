/** A model at a depth, ready to give muons. Runs in the worker. */

import { fetchFile } from "./fetch_file.js";
import { Latents, modelStream } from "./latents.js";
import { Network } from "./network.js";

export class Generator {
    /**
     * @param {import("./models.js").Model} model
     * @param {Network} network
     * @param {import("./network.js").Tensors} tables of its depth
     * @param {Latents} latents
     */
    constructor(model, network, tables, latents) {
        this.model = model;
        this.network = network;
        this.tables = tables;
        this.latents = latents;
        this.stream = modelStream(model);
    }

    /**
     * @param {import("./models.js").Model} model
     * @throws {Error} in words
     */
    static async open(model) {
        const [network, latents] = await Promise.all([Network.of(model), openLatents()]);
        return new Generator(model, network, await network.at(model.depth_m, model.surface), latents);
    }

    /**
     * Muons `first` to `first + count - 1` of a seed, as `deepmuon-gen` makes them.
     *
     * @param {bigint} seed 0 to 2^64 - 1
     * @param {number} first a multiple of `muonsInBlock()`
     * @param {number} count
     * @returns {Promise<import("./tally.js").Muons>}
     * @throws {Error} in words, if the model fails
     */
    async sample(seed, first, count) {
        const { latent_size, muons_per_draw } = this.model;
        const draws = Math.ceil(count / muons_per_draw);
        const latent = this.latents.draw(seed, this.stream, first / muons_per_draw, draws, latent_size);
        const { energy, direction, charge } = await this.make(latent);
        return {
            energy: energy.subarray(0, count),
            direction: direction.subarray(0, 3 * count),
            charge: charge.subarray(0, count),
        };
    }

    /**
     * The muons of latents.
     *
     * @param {Float32Array} latent those of each draw
     * @throws {Error} in words, if the model fails
     */
    make(latent) {
        return this.network.run(latent, this.tables);
    }

    /**
     * How many muons of a family come a second and m², here or at another depth; NaN if it does not know.
     *
     * @param {number} depth
     * @returns {Promise<number>}
     * @throws {Error} in words, if the model fails
     */
    async rateAt(depth) {
        const { rate_hz_per_m2 } = await this.network.at(depth, this.model.surface);
        return /** @type {Float32Array | undefined} */ (rate_hz_per_m2?.data)?.[0] ?? Number.NaN;
    }
}

/** @type {Promise<Latents> | undefined} */
let latents;

function openLatents() {
    latents ??= (async () => {
        const file = await fetchFile(new URL("engine/random.wasm", import.meta.url), "The generator of random numbers");
        return Latents.open(await file.arrayBuffer());
    })();
    return latents;
}

/** A model, ready to give muons. Runs in the worker. */

import { atDepth } from "./family.js";
import { fetchFile } from "./fetch_file.js";
import { Latents, modelStream } from "./latents.js";
import { isFamily } from "./models.js";

const ENGINE = new URL("engine/", import.meta.url);
const MODELS = new URL("models/", import.meta.url);

export class Generator {
    /**
     * @param {import("./models.js").Model} model
     * @param {typeof import("onnxruntime-web")} ort
     * @param {import("onnxruntime-web").InferenceSession} session
     * @param {Latents} latents
     */
    constructor(model, ort, session, latents) {
        this.model = model;
        this.ort = ort;
        this.session = session;
        this.latents = latents;
        this.stream = modelStream(model);
    }

    /**
     * @param {import("./models.js").Model} model
     * @throws {Error} in words
     */
    static async open(model) {
        const [ort, latents] = await Promise.all([openOnnxRuntime(), openLatents()]);
        const bytes = await fetchModel(model);
        try {
            const placed = isFamily(model) ? atDepth(bytes, model.depth_m, model.surface) : new Uint8Array(bytes);
            const session = await ort.InferenceSession.create(placed, { executionProviders: ["wasm"] });
            return new Generator(model, ort, session, latents);
        } catch (error) {
            throw new Error(`The model ${model.name} could not be opened: ${reason(error)}`);
        }
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
     * The muons of latents, and of a family how many come a second and m².
     *
     * @param {Float32Array} latent those of each draw
     * @returns {Promise<import("./tally.js").Muons & {flux: number | undefined}>}
     * @throws {Error} in words, if the model fails
     */
    async make(latent) {
        const { name, latent_size } = this.model;
        const shape = [latent.length / latent_size, latent_size];
        try {
            const made = await this.session.run({ latent: new this.ort.Tensor("float32", latent, shape) });
            return {
                energy: /** @type {Float32Array} */ (made.kinetic_energy.data),
                direction: /** @type {Float32Array} */ (made.direction.data),
                charge: /** @type {Int8Array} */ (made.charge.data),
                flux: /** @type {Float32Array | undefined} */ (made.rate_hz_per_m2?.data)?.[0],
            };
        } catch (error) {
            throw new Error(`The model ${name} failed: ${reason(error)}`);
        }
    }

    /** Give its memory back. */
    async close() {
        await this.session.release();
    }
}

/** @type {Promise<typeof import("onnxruntime-web")> | undefined} */
let onnxRuntime;

function openOnnxRuntime() {
    onnxRuntime ??= (async () => {
        const url = new URL("ort.wasm.bundle.min.mjs", ENGINE);
        await fetchFile(url, "ONNX Runtime"); // says why, where an import would not
        const ort = await import(url.href);
        ort.env.wasm.numThreads = 1; // more would need headers that few sites send
        ort.env.wasm.wasmBinary = await fetchBytes(new URL("ort-wasm-simd-threaded.wasm", ENGINE), "ONNX Runtime");
        return ort;
    })();
    return onnxRuntime;
}

/** @type {{sha256: string, bytes: ArrayBuffer} | undefined} */
let lastModel;

/**
 * The file of a model; that of the last one is kept, of which another depth may be wanted.
 *
 * @param {import("./models.js").Model} model
 */
async function fetchModel(model) {
    if (lastModel?.sha256 !== model.sha256) {
        const bytes = await fetchBytes(new URL(model.name, MODELS), "The model");
        await checkHash(bytes, model);
        lastModel = { sha256: model.sha256, bytes };
    }
    return lastModel.bytes;
}

async function openLatents() {
    return Latents.open(await fetchBytes(new URL("random.wasm", ENGINE), "The generator of random numbers"));
}

/**
 * @param {URL} url
 * @param {string} name
 */
async function fetchBytes(url, name) {
    return (await fetchFile(url, name)).arrayBuffer();
}

/**
 * @param {ArrayBuffer} bytes
 * @param {import("./models.js").Model} model
 */
async function checkHash(bytes, model) {
    if (!crypto.subtle) return; // only on https and localhost
    const hash = new Uint8Array(await crypto.subtle.digest("SHA-256", bytes));
    const found = Array.from(hash, (byte) => byte.toString(16).padStart(2, "0")).join("");
    if (found !== model.sha256) {
        throw new Error(`The model ${model.name} is damaged, or newer than this page: load the page again.`);
    }
}

/** @param {unknown} error */
function reason(error) {
    return (error instanceof Error ? error.message : String(error)).split("\n")[0];
}

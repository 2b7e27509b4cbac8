/** A model's network in ONNX Runtime. Runs in the worker. */

import { fetchFile } from "./fetch_file.js";
import { isFamily } from "./models.js";
import { Split } from "./split.js";

const ENGINE = new URL("engine/", import.meta.url);
const MODELS = new URL("models/", import.meta.url);

/** @typedef {import("./models.js").Model} Model */
/** @typedef {import("onnxruntime-web").InferenceSession} Session */
/** @typedef {import("onnxruntime-web").InferenceSession.OnnxValueMapType} Tensors by name */

export class Network {
    /**
     * @param {Model} model
     * @param {typeof import("onnxruntime-web")} ort
     * @param {Session} muons that makes muons of latents
     * @param {Session} [tables] of a family, that makes what the other one needs of a depth
     */
    constructor(model, ort, muons, tables) {
        this.model = model;
        this.ort = ort;
        this.muons = muons;
        this.tables = tables;
    }

    /**
     * The network of a model; the last one is kept, of which another depth may be wanted.
     *
     * @param {Model} model
     * @throws {Error} in words
     */
    static async of(model) {
        if (last?.model.sha256 !== model.sha256) {
            const opened = await Network.open(model);
            await last?.close();
            last = opened;
        }
        return last;
    }

    /** @param {Model} model */
    static async open(model) {
        const [ort, bytes] = await Promise.all([openOnnxRuntime(), fetchModel(model)]);
        /** @param {Uint8Array} file */
        const open = (file) => ort.InferenceSession.create(file, { executionProviders: ["wasm"] });
        return inWords(`The model ${model.name} could not be opened`, async () => {
            if (!isFamily(model)) return new Network(model, ort, await open(new Uint8Array(bytes)));
            const split = new Split(bytes);
            const tables = await open(split.modelOfTables());
            const kinds = await tables.run(placeOf(ort, tables, model.depth_m, model.surface));
            return new Network(model, ort, await open(split.modelOfMuons(kinds)), tables);
        });
    }

    /**
     * What makes the muons of a depth, and their rate; nothing of a model that has one depth alone.
     *
     * @param {number} depth in metres
     * @param {number} surface that they cross
     * @returns {Promise<Tensors>}
     * @throws {Error} in words, if the model fails
     */
    async at(depth, surface) {
        const { model, ort, tables } = this;
        if (!tables) return {};
        return inWords(`The model ${model.name} failed`, () => tables.run(placeOf(ort, tables, depth, surface)));
    }

    /**
     * The muons of latents.
     *
     * @param {Float32Array} latent those of each draw
     * @param {Tensors} tables as `at` gives them
     * @returns {Promise<import("./tally.js").Muons>}
     * @throws {Error} in words, if the model fails
     */
    async run(latent, tables) {
        const { model, muons, ort } = this;
        const shape = [latent.length / model.latent_size, model.latent_size];
        const needed = muons.inputNames.filter((name) => name in tables).map((name) => [name, tables[name]]);
        const feeds = { ...Object.fromEntries(needed), latent: new ort.Tensor("float32", latent, shape) };
        const made = await inWords(`The model ${model.name} failed`, () => muons.run(feeds));
        return {
            energy: /** @type {Float32Array} */ (made.kinetic_energy.data),
            direction: /** @type {Float32Array} */ (made.direction.data),
            charge: /** @type {Int8Array} */ (made.charge.data),
        };
    }

    /** Give its memory back. */
    async close() {
        await this.muons.release();
        await this.tables?.release();
    }
}

/** @type {Network | undefined} */
let last;

/**
 * @param {typeof import("onnxruntime-web")} ort
 * @param {Session} tables
 * @param {number} depth
 * @param {number} surface
 */
function placeOf(ort, tables, depth, surface) {
    /** @type {Record<string, import("onnxruntime-web").Tensor>} */
    const place = { depth_m: new ort.Tensor("float32", Float32Array.of(depth), []) };
    if (tables.inputNames.includes("surface")) place.surface = new ort.Tensor("int32", Int32Array.of(surface), []);
    else if (surface !== 0) throw new Error("It has no muons of a sphere.");
    return place;
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

/** @param {Model} model */
async function fetchModel(model) {
    const bytes = await fetchBytes(new URL(model.name, MODELS), "The model");
    await checkHash(bytes, model);
    return bytes;
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
 * @param {Model} model
 */
async function checkHash(bytes, model) {
    if (!crypto.subtle) return; // only on https and localhost
    const hash = new Uint8Array(await crypto.subtle.digest("SHA-256", bytes));
    const found = Array.from(hash, (byte) => byte.toString(16).padStart(2, "0")).join("");
    if (found !== model.sha256) {
        throw new Error(`The model ${model.name} is damaged, or newer than this page: load the page again.`);
    }
}

/**
 * @template Result
 * @param {string} trouble that an error means
 * @param {() => Promise<Result>} task
 */
async function inWords(trouble, task) {
    try {
        return await task();
    } catch (error) {
        const reason = (error instanceof Error ? error.message : String(error)).split("\n")[0];
        throw new Error(`${trouble}: ${reason}`);
    }
}

/**
 * Random numbers, the same as those of `deepmuon-gen`: made by random.wat, as docs/random_numbers.md says.
 *
 * @typedef {object} RandomModule
 * @property {WebAssembly.Memory} memory
 * @property {(blocks: number, seed: bigint, stream: bigint, purpose: bigint, firstBlock: bigint) => void} fill_latents
 */

const LARGEST_SEED = 2n ** 64n - 1n;
const PAGE = 65536; // bytes
const BLOCK = 8; // latents

/** The purpose of the numbers that make muons. */
export const FOR_LATENTS = 0n;

/** The purpose of the numbers that put muons where they enter a target. */
export const FOR_PLACES = 2n;

/** Draws of these begin with a whole block, whatever the latents of a draw. */
export const DRAWS_STEP = BLOCK;

/** A seed from the system's randomness, 0 to 2^63 - 1, as the command takes one. */
export function newSeed() {
    return crypto.getRandomValues(new BigUint64Array(1))[0] >> 1n;
}

/**
 * The seed that a reader typed.
 *
 * @param {string} text
 * @throws {RangeError} in words, if it is none
 */
export function readSeed(text) {
    const digits = text.trim();
    if (!/^\d+$/.test(digits) || BigInt(digits) > LARGEST_SEED) {
        throw new RangeError("A seed is a whole number from 0 to 2⁶⁴ − 1; empty, it is a new one each time.");
    }
    return BigInt(digits);
}

/**
 * The stream of a model's random numbers: the FNV-1a hash of what it says of itself, 0 to 2^64 - 1.
 *
 * @param {{architecture: string, flux: string, medium: string, surface?: number, depth_m: number}} model
 */
export function modelStream({ architecture, flux, medium, surface = 0, depth_m }) {
    const depth = new Uint8Array(4);
    new DataView(depth.buffer).setFloat32(0, depth_m, true);
    const text = new TextEncoder().encode(`${architecture}/${flux}/${medium}/${surface}/`);
    let stream = 0xcbf29ce484222325n;
    for (const byte of [...text, ...depth]) stream = BigInt.asUintN(64, (stream ^ BigInt(byte)) * 0x100000001b3n);
    return stream;
}

export class Latents {
    /** @param {RandomModule} module */
    constructor(module) {
        this.module = module;
    }

    /**
     * @param {BufferSource} bytes random.wasm
     */
    static async open(bytes) {
        const { instance } = await WebAssembly.instantiate(bytes);
        return new Latents(/** @type {any} */ (instance.exports));
    }

    /**
     * The latents of consecutive draws: independent, uniform, strictly inside (-1, 1). They last until the next call.
     *
     * @param {bigint} seed 0 to 2^64 - 1
     * @param {bigint} stream as `modelStream` gives it
     * @param {number} first of the draws, a multiple of `DRAWS_STEP`
     * @param {number} draws
     * @param {number} latentSize
     * @param {bigint} [purpose]
     */
    draw(seed, stream, first, draws, latentSize, purpose = FOR_LATENTS) {
        const { memory, fill_latents } = this.module;
        const blocks = Math.ceil((draws * latentSize) / BLOCK);
        const missing = blocks * BLOCK * Float32Array.BYTES_PER_ELEMENT - memory.buffer.byteLength;
        if (missing > 0) memory.grow(Math.ceil(missing / PAGE));
        const firstBlock = BigInt((first / BLOCK) * latentSize);
        fill_latents(blocks, BigInt.asIntN(64, seed), BigInt.asIntN(64, stream), purpose, firstBlock);
        return new Float32Array(memory.buffer, 0, draws * latentSize);
    }
}
